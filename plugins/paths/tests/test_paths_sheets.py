"""The tops of layers along a floor: what is left out to save time changes nothing."""

from __future__ import annotations

from collections.abc import Callable

import damageest_paths.sheets.sheets
import numpy as np
import pytest
from damageest_paths.sheets.floor import Depth, Floor, make_floor
from damageest_paths.sheets.sheets import Grid, Sheet, lay_ground, lay_sheet, make_grid, measure_reach
from path_cavities import bowl, groove, make_process, prepare, stair

from damageest.artefacts import Floats, Mesh
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import to_arrays
from tests.path_shapes import Loss

HEIGHT = 0.5
PROCESS = make_process()


def lay(floor: Floor, grid: Grid) -> list[Sheet]:
    sheets = [lay_ground(floor, grid)]
    for number in range(4):
        sheets.append(lay_sheet(floor, grid, sheets[-1], (number + 1) * HEIGHT, PROCESS, HEIGHT))
    return sheets[1:]


def make_rough_floor() -> Floor:
    """Pits and tips, 1 apart and up to 3 high."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0), indexing="ij")
    vertices = np.stack([x, y, 3 * rng.random((12, 12))], axis=-1).reshape(-1, 3)
    a = (np.arange(11)[:, None] * 12 + np.arange(11)).ravel()
    faces = np.concatenate([np.stack([a, a + 12, a + 13], 1), np.stack([a, a + 13, a + 1], 1)])
    return make_floor(vertices, faces, 1.2)


@pytest.mark.variants(1)
@pytest.mark.parametrize("make", [bowl, groove, stair])
def test_reach_is_the_least_distance_within_a_layer(make: Callable[[], Loss]) -> None:
    scene = prepare(make())
    body = scene.frame.move(scene.body)
    solid = Mesh(*to_arrays(body))
    grid = make_grid(scene.floor, to_arrays(body.refine_to_length(scene.process.bead.width))[0], scene.process)
    spacing = 3 * grid.edge
    for sheet in lay(scene.floor, grid):
        found = sheet.is_found
        places = [sheet.points - share * HEIGHT * sheet.upward for share in np.arange(9) / 8]
        wanted = np.min([signed_distance(each, solid)[0] for each in places], axis=0)
        reach = measure_reach(sheet, solid, HEIGHT, spacing)
        near = found & (np.abs(wanted) < spacing)
        assert near.any()
        np.testing.assert_allclose(reach[near], wanted[near], atol=1e-9)
        assert (np.sign(reach[found]) == np.sign(wanted[found])).all()
        assert np.isinf(reach[~found]).all()


def test_columns_that_go_to_and_fro_are_left_where_they_would_end(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    measure = Floor.measure

    def count(self: Floor, points: Floats) -> Depth:
        asked.append(len(points))
        return measure(self, points)

    monkeypatch.setattr(Floor, "measure", count)
    floor = make_rough_floor()
    grid = make_grid(floor, floor.mesh.vertices + np.array([0.0, 0.0, 1.0]), PROCESS)
    sheets = lay(floor, grid)
    few = sum(asked)
    monkeypatch.setattr(damageest_paths.sheets.sheets, "CYCLE", -1.0)
    to_the_end = lay(floor, grid)
    assert few < 0.9 * (sum(asked) - few)
    for sheet, other in zip(sheets, to_the_end, strict=True):
        assert (sheet.is_found == other.is_found).all()
        assert sheet.is_found.any()
        assert not sheet.is_found[grid.near].all()
        np.testing.assert_allclose(sheet.points, other.points, atol=1e-8)
        np.testing.assert_allclose(sheet.normals, other.normals, atol=1e-8)
