"""What is between the nozzle and the bead: intact metal is in no beam, in few beads, and the rest is listed."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats, Solid
from damageest.geometry.distance import signed_distance, winding_number
from tests.path_shapes import BLOCK, OPTIONS, Loss, cut, dent, plan

UP = (0.0, 0.0, 1.0)
CASES: dict[str, dict[str, Any]] = {
    "dent": {"direction": UP},
    "corner": {},
    "tilted": {"axes": 5, "direction": UP},
    "contour": {"direction": UP, "pattern": "contour"},
}


@cache
def make_case(name: str) -> tuple[Loss, DepositPath]:
    loss = dent() if name in ("dent", "contour") else cut(BLOCK, Manifold.cube((16, 14, 9)).translate((12, 8, -5)))
    return loss, plan(loss, **CASES[name])


def place_samples(path: DepositPath, step: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Points on the tops of beads, a share ``step`` of the bead's width apart, with tool axes, normals and heights."""
    rows = []
    for k in np.flatnonzero(path.on):
        start, stop = path.points[k - 1], path.points[k]
        count = max(int(np.ceil(np.linalg.norm(stop - start) / (step * path.width))), 1)
        share = (np.arange(count)[:, None] + 0.5) / count
        axes = path.axes[k - 1] + share * (path.axes[k] - path.axes[k - 1])
        normals = np.tile(path.normals[k], (count, 1))
        heights = np.full((count, 1), path.heights[path.part[k] - 1])
        rows.append(np.hstack([start + share * (stop - start), axes, normals, heights]))
    found = np.concatenate(rows)
    return found[:, :3], found[:, 3:6], found[:, 6:9], found[:, 9]


def measure_beam(path: DepositPath, metal: Solid) -> float:
    """The share of the beads in whose beam, somewhat thinner than a bead, there is metal; by winding numbers."""
    points, axes, _, _ = place_samples(path, 0.5)
    side = np.cross(axes, [0.36, 0.48, 0.8])
    side /= np.linalg.norm(side, axis=1)[:, None]
    other = np.cross(axes, side)
    hit = np.zeros(len(points), bool)
    for up in np.array([0.3, 0.6, 1.0]) * path.standoff:
        for turn in np.arange(6) * np.pi / 3:
            beside = 0.45 * path.width * (np.cos(turn) * side + np.sin(turn) * other)
            hit |= winding_number(points + up * axes + beside, metal) > 0.5
        hit |= winding_number(points + up * axes, metal) > 0.5
    return float(hit.mean())


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", sorted(CASES, reverse=True))
def test_no_metal_is_in_the_beam(name: str) -> None:
    loss, path = make_case(name)
    assert path.on.any()
    assert measure_beam(path, loss.left) == 0


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", CASES)
def test_beads_lie_on_the_deposit(name: str) -> None:
    """Their middles are not in intact metal, and none is in the air."""
    loss, path = make_case(name)
    points, _, normals, heights = place_samples(path, 0.25)
    middle = points - 0.5 * heights[:, None] * normals
    metal, deposit = signed_distance(middle, loss.left)[0], signed_distance(middle, loss.lost)[0]
    assert np.minimum(metal, deposit).max() <= path.width / 2
    assert (winding_number(points - 1e-3 * normals, loss.left) < 0.5).all()
    assert path.fill is not None
    assert path.fill.sunk <= 0.05 * path.deposit_volume


@pytest.mark.parametrize("name", CASES)
def test_no_pass_is_shorter_than_half_a_bead(name: str) -> None:
    _, path = make_case(name)
    lengths = np.bincount(path.number[path.on], weights=path.moves[path.on])[1:]
    assert lengths.min() >= path.width / 2 * (1 - 1e-6)
    assert len(path.kinds) == len(lengths)


@pytest.mark.parametrize("name", CASES)
def test_filled_gaps_and_unreached_are_the_whole(name: str) -> None:
    _, path = make_case(name)
    assert path.fill is not None
    total = path.fill.of_deposit + (path.fill.gap + path.unreached_volume) / path.deposit_volume
    assert total == pytest.approx(1, abs=0.02)


def make_roofed(high: float) -> Loss:
    """A trough under a thin roof that is ``high`` above it and covers half of it."""
    roof = Manifold.cube((12, 30, 0.5)).translate((0, -15, high))
    post = Manifold.cube((2, 30, high + 0.5)).translate((12, -15, 0))
    return cut(BLOCK + roof + post, Manifold.cube((16, 14, 2)).translate((-8, -7, -2)))


def test_what_a_roof_shades_is_unreached_and_says_why() -> None:
    """The nozzle's body passes above the roof, 2 high: only the beam meets it."""
    needle = {"tip_radius": 0.5, "cone_angle": 10.0, "length": 60.0, "body_radius": 8.0}
    options = {"direction": UP, "standoff": 8.0, "nozzle": needle}
    roofed = plan(make_roofed(2.0), **options)
    shaded = sum(item.volume for item in roofed.unreached if "line of sight" in item.why)
    # half of the trough lies under the roof; its upper layer stands on nothing there
    assert 0.25 <= shaded / roofed.deposit_volume <= 0.6
    assert 0.45 <= roofed.unreached_volume / roofed.deposit_volume <= 0.6
    assert measure_beam(roofed, make_roofed(2.0).left) == 0
    assert roofed.points[roofed.on][:, 0].max() <= -0.9 * OPTIONS["width"] / 2
    free = plan(cut(BLOCK, Manifold.cube((16, 14, 2)).translate((-8, -7, -2))), **options)
    assert free.unreached_volume < 0.01 * free.deposit_volume


@pytest.mark.slow
def test_a_wider_beam_keeps_away_from_a_wall() -> None:
    """A step before a wall: the beam of a cone needs room beside it that a thin one does not."""
    wall = Manifold.cube((4, 30, 4)).translate((8, -15, 0))
    loss = cut(BLOCK + wall, Manifold.cube((16, 14, 2)).translate((-8, -7, -2)))
    needle = {"tip_radius": 0.5, "cone_angle": 5.0, "length": 60.0, "body_radius": 3.0}
    thin, wide = (
        plan(loss, direction=UP, standoff=5.0, nozzle={**needle, "beam": beam})
        for beam in ({"radius": 0.5}, {"radius": 0.5, "cone": 20.0})
    )
    reach = [path.points[path.on][:, 0].max() for path in (thin, wide)]
    assert 8 - reach[0] <= 1.01
    assert 8 - reach[1] >= 0.5 + 4 * np.tan(np.radians(20.0)) * 0.9
    assert any("line of sight" in item.why for item in wide.unreached)


@pytest.mark.parametrize("rise", [3, 10])
def test_a_strip_too_narrow_beside_a_wall_is_listed(rise: float) -> None:
    """The middle of a bead would lie beside the strip: it is no gap of what is reachable. What is next to it is filled;
    where the wall keeps the nozzle away, what its overhang would hold of a bead is no gap either."""
    lost = Manifold.cube((0.7, 24, 3)).translate((0, -12, 0)) + Manifold.cube((10, 10, 3)).translate((0, 2, 0))
    wall = Manifold.cube((10, 40, rise + 10)).translate((-10, -20, -10))
    wall += Manifold.cube((30, 40, 10)).translate((0, -20, -10))
    path = plan(cut(wall + lost, lost), direction=(0.0, 0.0, 1.0), axes=3)
    assert path.fill is not None
    assert path.fill.filled > 0.985
    narrow = 0.7 * (24 - 10) * 3
    thin = [each.volume for each in path.unreached if "so thin over intact metal" in each.why]
    assert 0.75 * narrow < sum(thin) < 2 * narrow
    listed = path.unreached_volume / path.deposit_volume
    assert path.fill.of_deposit + listed + path.fill.gap / path.deposit_volume == pytest.approx(1, abs=0.02)


def test_few_passes_and_little_travel() -> None:
    """A layer of one piece is a ring and rows in one pass; two passes at most."""
    _, path = make_case("dent")
    assert path.passes <= 2 * path.layers
    assert path.travel < 0.4 * path.length
    assert path.fill is not None
    assert path.fill.filled > 0.99
