"""Solids written as STEP are read back by CadQuery: volume, unit, bodies, cavities, flat sides in one piece."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_cadquery.solids.facets import find_facets
from damageest_cadquery.writing import step as _step
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.simplification import simplify_within
from damageest.geometry.solids import to_solid
from damageest.geometry.units import MILLIMETRES
from damageest.stages.export import Body
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


def solid(body: Any) -> Solid:
    made = to_solid(body)
    assert made is not None
    return made


def bitten() -> Any:
    """A block with a through hole, a cavity that nothing leads to, a bite off its top, and a second body."""
    block = Manifold.cube((40, 30, 20)) - Manifold.cylinder(30, 4, 4, 48).translate((30, 20, -5))
    block = block - Manifold.sphere(3, 32).translate((10, 22, 8)) - Manifold.sphere(6, 64).translate((12, 10, 21))
    return block + Manifold.cube((5, 5, 5)).translate((60, 1, 2))


def written(made: Solid, folder: Path, unit: str = "mm") -> Any:
    done = _step.write_step(folder, "a", [Body("deposit 'site-1'", made, (1, 2, 3))], unit)
    assert done.files == ("a.step",)
    assert done.notes == ()
    return cq.importers.importStep(str(folder / "a.step"))


@pytest.mark.variants(slow=4)
@pytest.mark.parametrize(
    "unit", [pytest.param(unit, marks=pytest.mark.slow) for unit in ("in", "um", "mm", "cm", "m", "ft")]
)
def test_volume_and_unit(unit: str, tmp_path: Path) -> None:
    scale = 1 / MILLIMETRES[unit]  # the same block, whatever the unit
    made = solid(bitten().scale((scale,) * 3))
    back = written(made, tmp_path, unit)
    assert sum(body.Volume() for body in back.solids().vals()) == pytest.approx(bitten().volume(), rel=1e-6)
    assert len(back.solids().vals()) == 2
    assert all(body.isValid() for body in back.solids().vals())
    box = back.combine().val().BoundingBox()
    np.testing.assert_allclose((box.xmin, box.xmax, box.zmax), (0, 65, 20), atol=1e-3)
    from damageest_cadquery.brep import Brep

    part = Brep(path=tmp_path / "a.step").run(unit=unit, tolerance=scale)
    assert part.volume == pytest.approx(made.volume, rel=1e-6)
    text = (tmp_path / "a.step").read_text()
    said = {"um": "SI_UNIT(.MICRO.", "mm": "SI_UNIT(.MILLI.", "cm": "SI_UNIT(.CENTI.", "m": "SI_UNIT($,.METRE.)"}
    assert said.get(unit, "CONVERSION_BASED_UNIT('INCH'" if unit == "in" else "CONVERSION_BASED_UNIT('FOOT'") in text


def test_flat_sides_are_one_face_with_their_holes(tmp_path: Path) -> None:
    made = solid(Manifold.cube((40, 30, 20)) - Manifold.cylinder(30, 4, 4, 48).translate((30, 20, -5)))
    planar = find_facets(made)
    assert len(planar) == 6 + 48
    assert sorted(len(face.loops) for face in planar)[-2:] == [2, 2], "the hole goes through two of the sides"
    back = written(made, tmp_path)
    assert len(back.faces().vals()) == 6 + 48
    assert len(back.edges().vals()) == 12 + 3 * 48
    assert back.val().Volume() == pytest.approx(made.volume, rel=1e-9)


def test_edges_without_length_and_faces_without_area(tmp_path: Path) -> None:
    cube = solid(Manifold.cube((10, 10, 10)))
    a, b, c = cube.faces[0]
    count = len(cube.vertices)
    middle = (cube.vertices[a] + cube.vertices[b]) / 2
    over = next(i for i, face in enumerate(cube.faces.tolist()) if i and {a, b} <= set(face))
    (d,) = set(cube.faces[over].tolist()) - {a, b}
    m, n, k = count, count + 1, count + 2  # m and n at one place, k on the same edge: triangles without area
    vertices = np.concatenate([cube.vertices, [middle, middle, 0.7 * middle + 0.3 * cube.vertices[b]]])
    faces = [[a, m, c], [m, b, c], [a, n, m], [n, k, m], [k, b, m], [a, d, n], [n, d, k], [k, d, b]]
    made = Solid(vertices, np.concatenate([np.delete(cube.faces, [0, over], axis=0), faces]))
    assert made.volume == pytest.approx(1000)
    back = written(made, tmp_path)
    assert back.val().Volume() == pytest.approx(1000, rel=1e-6)


def test_a_cavity_stays_one(tmp_path: Path) -> None:
    made = solid(Manifold.cube((10, 10, 10)) - Manifold.cube((2, 3, 4)).translate((3, 3, 3)))
    (pair,) = split_shells(made)
    assert [len(pair[0].faces), [len(cavity.faces) for cavity in pair[1]]] == [12, [12]]
    (back,) = written(made, tmp_path).solids().vals()
    assert back.Volume() == pytest.approx(1000 - 24)
    assert len(back.Shells()) == 2


@pytest.mark.slow
def test_fewer_faces_within_the_detail(tmp_path: Path) -> None:
    rough = solid(Manifold.cube((20, 20, 20)) - Manifold.sphere(6, 256).translate((10, 10, 20)))
    less = simplify_within(rough, 0.02)
    assert len(less.faces) < len(rough.faces) / 2
    back = written(less, tmp_path)
    assert len(back.faces().vals()) <= len(less.faces)
    assert back.val().Volume() == pytest.approx(rough.volume, rel=5e-3)


@pytest.mark.slow
def test_the_same_bytes_each_time_and_its_name(tmp_path: Path) -> None:
    made = solid(bitten())
    texts = []
    for _ in range(2):
        written(made, tmp_path, "in")
        written(made, tmp_path)  # whose unit must not stick
        texts.append((tmp_path / "a.step").read_bytes())
    assert texts[0] == texts[1]
    products = re.findall(rb"= PRODUCT\('(.*?)',", texts[0])
    assert products == [b"deposit ''site-1''"]
    assert b"1970-01-01" in texts[0][:2000]


def test_too_many_faces_are_left_out_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_step, "MAX_FACES", 100)
    done = _step.write_step(tmp_path, "a", [Body("x", solid(bitten()), (1, 2, 3))], "mm")
    assert done.files == ()
    assert "a.step was not written" in done.notes[0]
    assert not list(tmp_path.iterdir())
