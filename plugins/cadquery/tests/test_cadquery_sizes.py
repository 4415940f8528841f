"""Damage volumes of parts of micrometres, as in files of metres: there the precision of OpenCASCADE is coarse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from damageest_cadquery import exact
from damageest_cadquery.reading.read import explore, read
from damageest_cadquery.solids.split import measure_volume

import damageest
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


def test_a_part_is_enlarged_by_a_power_of_two_where_its_size_is_unusual() -> None:
    assert [exact.find_enlargement(size) for size in (0.5, 37.0, 5000.0)] == [1, 1, 1]
    for size in (0.004, 41_000.0):
        factor = exact.find_enlargement(size)
        assert 70 < factor * size < 142
        assert float(factor).hex().startswith("0x1.0000000000000p")


@pytest.mark.slow
def test_a_part_of_micrometres_has_exact_damage_volumes(tmp_path: Path) -> None:
    """A block of 30 x 20 x 12 times 1e-4, with a bore, in a BREP file, which has no unit."""
    from OCP.BRepTools import BRepTools
    from OCP.TopAbs import TopAbs_FACE

    size = 1e-4
    shape = cq.Workplane().box(30, 20, 12).faces(">Z").workplane().pushPoints([(-8, 0)]).hole(6).val().scale(size)
    BRepTools.Write_s(shape.wrapped, str(tmp_path / "block.brep"))
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2 * size, "part": str(tmp_path / "block.brep"), "align": "none",
        "report": "none", "export": {"format": ["step"]}, "accept": "all",
        "scan": {"use": "simulate", "points": 6000, "noise": 0.04 * size, "seed": 4, "damage": [
            {"tool": "box", "centre": [15 * size, 0, 6 * size], "size": [8 * size, 5 * size, 6 * size]}]},
    }  # fmt: skip
    result = damageest.run(job, output=tmp_path / "out")
    (site,) = json.loads((tmp_path / "out/result.json").read_text())["sites"]
    form = site["exact"]
    assert form["form"] != "none", form["tried"]
    assert form["volume"] == pytest.approx(result.sites[0].damage.volume, rel=4e-3)
    assert form["farthest"] < 2 * 0.2 * size
    model = read(tmp_path / "out/damage/site-1.step", ".step")
    (solid,) = model.solids
    faces = explore(solid, TopAbs_FACE)
    assert len(faces) == form["faces"]
    assert all(model.name_of(face) for face in faces)
    assert measure_volume(solid) == pytest.approx(form["volume"], rel=1e-4)
    assert cq.Shape.cast(solid).isValid()
    top = max(faces, key=lambda face: cq.Shape.cast(face).Center().z)
    assert cq.Shape.cast(top).Center().z == pytest.approx(6 * size, rel=1e-6), "it lies where the part does"
