"""Depth below the skin that is lost, on shapes whose depth is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Part, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.lost_depth import LostDepth, measure_lost_depth


def box(size: tuple[float, float, float], middle: tuple[float, float, float]) -> trimesh.Trimesh:
    made = trimesh.creation.box(size)
    made.apply_translation(middle)
    return made


def ball(radius: float, middle: tuple[float, float, float]) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(4, radius)
    made.apply_translation(middle)
    return made


def turned_box(size: tuple[float, float, float], middle: tuple[float, float, float]) -> trimesh.Trimesh:
    made = box(size, (0, 0, 0))
    made.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, [0, 1, 0]))
    made.apply_translation(middle)
    return made


SHEET, BLOCK = box((60, 60, 2), (0, 0, -1)), box((60, 60, 30), (0, 0, -15))
LUG = trimesh.boolean.union([BLOCK, box((8, 8, 13.6), (0, 0, 6.7))], engine="manifold")
BOSS = trimesh.boolean.union([BLOCK, box((30, 30, 5.1), (0, 0, 2.45))], engine="manifold")
BORE = trimesh.boolean.difference([BLOCK, trimesh.creation.cylinder(12, 99, sections=128)], engine="manifold")
CASES = {
    "pit in a sheet": (SHEET, ball(10, (0, 0, 8.4)), 1.6),
    "shallow pit in a sheet": (SHEET, ball(10, (0, 0, 9.4)), 0.6),
    "sheet worn through": (SHEET, ball(10, (0, 0, 7.5)), 2.0),
    "hole": (SHEET, box((10, 10, 9), (0, 0, 0)), 2.0),
    "pit in a block": (BLOCK, ball(10, (0, 0, 8.4)), 1.6),
    "chipped edge": (BLOCK, turned_box((10, 60, 10), (30, 0, 0)), 10 / 8**0.5),
    "corner": (BLOCK, ball(6, (30, 30, 0)), 6 / 3**0.5),
    "lug": (LUG, box((9, 9, 20), (0, 0, 10)), 13.5),
    "boss": (BOSS, box((40, 40, 20), (0, 0, 10)), 5.0),
    "worn bore": (BORE, trimesh.creation.cylinder(12.4, 99, sections=128), 0.4),
    "pit in a shaft": (trimesh.creation.cylinder(5, 60, sections=96), ball(5, (7, 0, 0)), 3.0),
}


@pytest.mark.parametrize("name", CASES)
def test_depth_is_that_below_the_lost_skin(name: str) -> None:
    whole, tool, deep = CASES[name]
    lost = trimesh.boolean.intersection([whole, tool], engine="manifold")
    part, damage = Part(whole.vertices, whole.faces), Solid(lost.vertices, lost.faces)
    assert measure_lost_depth(damage, part) == pytest.approx(deep, rel=0.02)


@pytest.mark.parametrize("name", ["pit in a block", "pit in a shaft", "worn bore"])
def test_on_thick_metal_it_is_the_distance_to_the_skin(name: str) -> None:
    whole, tool, _ = CASES[name]
    lost = trimesh.boolean.intersection([whole, tool], engine="manifold")
    part, damage = Part(whole.vertices, whole.faces), Solid(lost.vertices, lost.faces)
    places = LostDepth.build(damage, part).below
    places = places[np.abs(places[:, 2] + 15) < 14] if name == "worn bore" else places  # the bore's ends are not lost
    depth, normals = LostDepth.build(damage, part).measure(places)
    np.testing.assert_allclose(depth, distance_to_mesh(places, part), atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_no_places_have_no_depth() -> None:
    lost = trimesh.boolean.intersection([BLOCK, ball(6, (0, 0, 0))], engine="manifold")
    part, damage = Part(BLOCK.vertices, BLOCK.faces), Solid(lost.vertices, lost.faces)
    assert measure_lost_depth(damage, part, np.empty((0, 3))) == 0
