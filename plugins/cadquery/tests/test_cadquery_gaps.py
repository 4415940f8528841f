"""Surfaces without a solid: gaps between them are closed up to a limit, and it is said how large they were."""

from __future__ import annotations

from pathlib import Path

import pytest
from damageest_cadquery.brep import Brep

from damageest.errors import InputError
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cadquery = import_for("cadquery", "cadquery")

SIZE = (70.0, 40.0, 20.0)
VOLUME = 56_000.0


def write_faces(path: Path, gap: float) -> Path:
    """The faces of a box, each smaller by ``gap`` at its corners, as surfaces alone."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Pnt, gp_Trsf
    from OCP.IGESControl import IGESControl_Writer

    writer = IGESControl_Writer("MM", 0)
    for face in cadquery.Workplane().box(*SIZE).faces().vals():
        middle, shrunk = face.Center(), gp_Trsf()
        shrunk.SetScale(gp_Pnt(middle.x, middle.y, middle.z), 1 - 2 * gap / face.BoundingBox().DiagonalLength)
        writer.AddShape(BRepBuilderAPI_Transform(face.wrapped, shrunk, True).Shape())
    writer.ComputeModel()
    writer.Write(str(path))
    return path


@pytest.mark.parametrize("gap", [0.0, 0.01, 0.05])
def test_gaps_up_to_a_thousandth_of_the_part_are_closed_and_named(gap: float, tmp_path: Path) -> None:
    part = Brep(path=write_faces(tmp_path / "part.igs", gap)).run(unit="mm", tolerance=None)
    assert part.volume == pytest.approx(VOLUME, rel=0.01)
    assert gap / 2 <= part.tessellation_error <= 2 * gap
    assert ("over gaps" in " ".join(part.notes)) == (gap > 0)


def test_larger_ones_are_refused_until_the_job_says_how_large(tmp_path: Path) -> None:
    path = write_faces(tmp_path / "part.igs", 0.3)
    with pytest.raises(InputError, match=r"open edges.*part\.gap"):
        Brep(path=path).run(unit="mm", tolerance=None)
    part = Brep(path=path, gap=0.05).run(unit="cm", tolerance=None)
    assert part.volume == pytest.approx(VOLUME / 1000, rel=0.03)
