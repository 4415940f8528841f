"""Where `allowance: milling` has no room for its stock: gaps, bores, walls in the way, concave corners."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.errors import StageError
from damageest.geometry.bodies import split_shells
from damageest.geometry.solids import to_manifold
from tests.stages.allowance.shapes import (
    INSET,
    TOLERANCE,
    blade,
    bored,
    bracket,
    comb,
    deposit_on,
    dovetail,
    make_damage,
    nearest,
    part_of,
    skin_points,
    solid_of,
)


def test_stock_on_both_faces_of_a_thin_blade() -> None:
    tool = Manifold.cube((40, 40, 8), True).translate((0, 0, 30))
    deposit = deposit_on(blade(), tool, outer=0.5)
    points, normals = skin_points(solid_of(blade() ^ tool), part_of(blade()), 400, 3)
    away = nearest(points + 0.5 * normals, deposit)[0]
    assert deposit.thickness is not None
    assert deposit.thickness[0] >= 0.5
    assert deposit.thickness[2] <= 0.5 + TOLERANCE
    assert np.percentile(away, 95) < TOLERANCE


GAP = Manifold.cube((11, 6, 5)).translate((0, 4, 9))
"""Takes the walls of both teeth beside a gap of the comb."""


@pytest.mark.parametrize(("outer", "fits"), [(1.4, True), (1.6, False)])
def test_a_gap_narrower_than_twice_the_stock(outer: float, fits: bool) -> None:
    flanks = [{"facing": {"direction": [k, 0, 0], "angle": 20}, "outer": outer} for k in (-1, 1)]
    if fits:
        assert deposit_on(comb(3.0), GAP, targets=flanks).notes == ()
        return
    message = r"no room for the stock at \((4|7), .*\): 3 is free there, but the stock is 1.6 high and 1.6 on"
    with pytest.raises(StageError, match=message):
        deposit_on(comb(3.0), GAP, targets=flanks)
    clipped = deposit_on(comb(3.0), GAP, targets=flanks, interference="clip")
    assert "clipped" in clipped.notes[0]
    between = Manifold.cube((3, 6, 4)).translate((4, 4, 9))
    assert (to_manifold(clipped) ^ between).volume() == pytest.approx(between.volume(), rel=INSET)


def test_a_bore_that_would_close_is_refused() -> None:
    tool = Manifold.cylinder(6, 8, 8, 64).translate((15, 10, 8))
    inward = {"half_space": {"point": [0, 0, 11.9], "normal": [0, 0, -1]}, "outer": 5.5}
    with pytest.raises(StageError, match=r"no room .* the stock is 5.5 high and 5.5 on the opposite wall"):
        deposit_on(bored(), tool, targets=[inward])
    assert deposit_on(bored(), tool, targets=[{**inward, "outer": 2.0}]).thickness is not None


def test_an_intact_wall_in_the_way_is_refused() -> None:
    tool = Manifold.cube((4, 6, 5)).translate((0, 4, 9))  # one tooth alone; the next one is 3 away
    with pytest.raises(StageError, match=r"3 is free there, but the stock is 3.5 high"):
        deposit_on(comb(3.0), tool, outer=3.5)
    deposit = deposit_on(comb(3.0), tool, outer=3.5, interference="clip")
    left = comb(3.0) - tool
    assert (to_manifold(deposit) ^ left).volume() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(("less", "error", "fits"), [(0.0, 0.003, True), (0.0, 0.0, False), (0.05, 0.003, False)])
def test_a_pin_that_touches_its_bore_is_no_gap_without_room(less: float, error: float, fits: bool) -> None:
    """Between their triangles, which are not the same, slits are left that neither of them has. A real gap is none."""
    pin = Manifold.cylinder(12, 5 - less, 5 - less, 96).rotate((0, 0, 180 / 96)).translate((15, 10, 0))
    foot = Manifold.cylinder(1, 6, 6, 96).translate((15, 10, 0))
    body, tool = bored() + pin + foot, Manifold.cube((8, 6, 4)).translate((13, 7, 9))
    part = replace(part_of(body), tessellation_error=error)
    if not fits:
        with pytest.raises(StageError, match="no room for the stock"):
            deposit_on(body, tool, part=part, outer=0.5)
        return
    deposit = deposit_on(body, tool, part=part, outer=0.5)
    assert deposit.stock_volume == pytest.approx(8 * 6 * 0.5, rel=0.01)
    assert any("touches an opposite wall" in note for note in deposit.notes)


@pytest.mark.parametrize("shape", [bracket, dovetail])
def test_a_concave_corner_is_no_wall_in_the_way(shape: Any) -> None:
    place = (6, 10, 6) if shape is bracket else (8.5, 15, 7)
    deposit = deposit_on(shape(), Manifold.cube((4, 4, 4), True).translate(place), outer=0.8)
    assert deposit.thickness is not None
    assert deposit.thickness[0] >= 0.8


def test_stock_that_is_clipped_everywhere_has_the_thickness_of_the_room() -> None:
    """Both gaps beside the middle tooth are 3 wide and get filled."""
    tool = Manifold.cube((4, 6, 5)).translate((7, 4, 9))
    flanks = [{"facing": {"direction": [k, 0, 0], "angle": 20}, "outer": 3.5} for k in (-1, 1)]
    deposit = deposit_on(comb(3.0), tool, targets=flanks, interference="clip")
    assert deposit.stock_volume == pytest.approx(2 * 3 * 6 * 4, rel=1e-3)
    assert deposit.thickness == pytest.approx((3, 3, 3), abs=1e-3)
    assert "nowhere as high as wanted: at most 3 of 3.5" in deposit.notes[1]
    assert not any("no stock on the skin" in note for note in deposit.notes)


@pytest.mark.slow
def test_a_bore_that_stock_closes_is_filled_to_its_axis() -> None:
    tool = Manifold.cylinder(6, 8, 8, 64).translate((15, 10, 8))
    inward = {"half_space": {"point": [0, 0, 11.9], "normal": [0, 0, -1]}, "outer": 5.5}
    deposit = deposit_on(bored(), tool, targets=[inward], interference="clip")
    assert deposit.stock_volume == pytest.approx(np.pi * 5**2 * 3.9, rel=0.01)
    assert deposit.thickness == pytest.approx((5.5, 5.5, 5.5), rel=0.01)
    assert "no stock on the skin" not in " ".join(deposit.notes)


def test_stock_between_two_damaged_walls_is_no_thicker_than_the_gap() -> None:
    flanks = [{"facing": {"direction": [k, 0, 0], "angle": 20}, "outer": 3.5} for k in (-1, 1)]
    tool = Manifold.cube((2, 6, 4)).translate((3, 4, 9)) + Manifold.cube((2, 6, 4)).translate((6, 4, 9))
    deposit = deposit_on(comb(3.0), tool, targets=flanks, interference="clip")
    assert deposit.thickness is not None
    assert deposit.thickness[2] == pytest.approx(3, abs=1e-3)


@pytest.mark.parametrize(
    ("body", "seed", "outer"),
    [
        (comb(3.0), 6, 0.5311353193740214),
        pytest.param(blade(), 4, 2.0067369720529458, marks=pytest.mark.slow),
    ],
)
def test_stock_that_overlaps_the_rim_encloses_no_bubble(body: Any, seed: int, outer: float) -> None:
    """Where stock on the skin and stock over the rim meet, something between them stayed open."""
    tool = make_damage(body, np.random.default_rng(seed))
    deposit = deposit_on(body, tool, outer=outer, overlap=0.5)
    assert not [cavity for _, cavities in split_shells(deposit) for cavity in cavities]


def test_what_is_clipped_is_told_with_place_and_volume() -> None:
    """Damage on one flank of a gap of 3 mm, with stock that would reach 1 mm into the other."""
    flank = [{"facing": {"direction": [1, 0, 0], "angle": 20}, "outer": 4.0}]
    tool = Manifold.cube((2, 6, 4)).translate((2, 4, 9))
    with pytest.raises(StageError, match="no room for the stock"):
        deposit_on(comb(3.0), tool, targets=flank)
    clipped = deposit_on(comb(3.0), tool, targets=flank, interference="clip")
    assert re.search(r"no room for the stock at \(4, .*; clipped there: [0-9.]+ of stock in volume", clipped.notes[0])
    told = float(re.search(r"clipped there: ([0-9.]+)", clipped.notes[0])[1])  # type: ignore[index]
    assert told == pytest.approx(6 * 4 * 1, rel=0.05)


def test_clip_does_not_refuse_what_it_cannot_clip() -> None:
    """A mitre over the edge of one flank reaches the other, which is to have no stock: it is said, with the place."""
    body = comb(3.0)
    rng = np.random.default_rng(13)
    tool = make_damage(body, rng)
    with pytest.raises(StageError, match="skin around the damage that must have none"):
        deposit_on(body, tool, outer=1.9305666644142077, overlap=1.5)
    clipped = deposit_on(body, tool, outer=1.9305666644142077, overlap=1.5, interference="clip")
    assert any("that must have none, for example at (11, " in note for note in clipped.notes)
