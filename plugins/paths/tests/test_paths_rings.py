"""Spirals: one pass from the border to the middle, whatever the border is like."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damageest_paths.fill.fill import list_lines
from damageest_paths.fill.joints import find_reversals
from damageest_paths.fill.lines import Line
from damageest_paths.fill.merging import merge_rings
from damageest_paths.fill.regions import cover, make_region, measure_length
from damageest_paths.fill.rings import list_levels, soften
from damageest_paths.fill.stripes import Bead
from damageest_paths.fill.trim import crosses
from damageest_paths.fill.weave import join_all
from manifold3d import CrossSection, OpType

from damageest.artefacts import Floats

BEAD = Bead(2.0, 1.4)


def ragged(long: float, wide: float) -> Any:
    """A rectangle with a rough border, as of a scanned floor."""
    x, y = np.meshgrid([-1.0, 1.0], [-1.0, 1.0])
    along = np.linspace(0, 1, 40, endpoint=False)
    corners = np.array([[x[0, 0], y[0, 0]], [x[0, 1], y[0, 1]], [x[1, 1], y[1, 1]], [x[1, 0], y[1, 0]]])
    ring = np.concatenate([a + along[:, None] * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
    rough = 1 + 0.01 * np.random.default_rng(3).normal(size=(len(ring), 1))
    return make_region([ring * rough * [long / 2, wide / 2]])


@pytest.mark.parametrize("wide", [12.0, 12.7, 13.4, 14.1])
def test_a_long_region_is_one_spiral_that_ends_in_its_middle(wide: float) -> None:
    region = ragged(40.0, wide)
    lines = list_lines(region, "zigzag", BEAD, 0.0)
    long = [line for line in lines if measure_length(line.points) > 2 * BEAD.width]
    assert len(long) == 1
    assert not find_reversals(long[0].points, BEAD.width)
    assert (region - cover([line.points for line in lines], BEAD.width)).area() < 0.01 * region.area()


def count_reversals(region: Any) -> int:
    rings = [np.asarray(ring) for ring in region.to_polygons()]
    return sum(len(find_reversals(np.concatenate([ring, ring[:2]]), BEAD.width)) for ring in rings)


def test_a_ring_goes_round_a_spike_in_an_arc() -> None:
    region = CrossSection.square((20, 12))
    spike = make_region([np.array([[8.8, -3], [11.2, -3], [10, 4]])])
    inner = soften(region, CrossSection.square((40, 40)).translate((-10, -10)) - spike, BEAD.width)
    assert count_reversals(region - spike) > 0
    assert count_reversals(inner) == 0
    assert (region - spike - inner).area() < 3.0


def test_a_ring_leaves_out_a_tip_in_which_it_would_come_back() -> None:
    tip = make_region([np.array([[0.0, 0], [20, 0], [20, 8], [26, 9], [20, 9.8], [20, 12], [0, 12]])])
    inner = soften(tip, None, BEAD.width)
    assert count_reversals(tip) > 0
    assert count_reversals(inner) == 0
    assert (tip - inner).area() < 1.0


def discs(line: Floats) -> Any:
    """What a bead covers, as discs close to each other."""
    length = np.linalg.norm(np.diff(line, axis=0), axis=1)
    dense = [
        a + t * (b - a)
        for a, b, far in zip(line, line[1:], length, strict=False)
        for t in np.arange(0, 1, 0.02 / max(far, 0.02))
    ]
    return CrossSection.batch_boolean([CrossSection.circle(1.0, 48).translate(tuple(p)) for p in dense], OpType.Add)


@pytest.mark.parametrize("step", [0.1, 0.5, 2.0])
def test_a_bead_is_covered_as_its_discs_are(step: float) -> None:
    line = np.cumsum(np.random.default_rng(7).normal(scale=step, size=(12, 2)), axis=0)
    drawn, true = cover([line], 2.0), discs(line)
    thick = 0.012
    assert (drawn - true.offset(thick)).area() < 1e-3
    assert (true - drawn.offset(thick)).area() < 1e-3


@pytest.mark.slow
def test_rings_round_holes_become_one() -> None:
    """Of a plate with two holes and an arm, in which no spiral goes from ring to ring."""
    plate = CrossSection.square((60, 24)) + CrossSection.square((8, 14)).translate((52, 20))
    region = plate - CrossSection.circle(4, 48).translate((14, 12)) - CrossSection.circle(5, 48).translate((44, 11))
    rings, _ = list_levels(soften(region.offset(-1.0), None, BEAD.width), BEAD)
    merged = merge_rings(rings, BEAD.step)
    assert len(rings) > 6
    assert len(merged) <= 2
    assert not find_reversals(np.concatenate([merged[0], merged[0][:3]]), BEAD.width)
    lines = list_lines(region, "zigzag", BEAD, 0.0)
    assert sum(measure_length(line.points) > 2 * BEAD.width for line in lines) <= 3
    assert (region - cover([line.points for line in lines], BEAD.width)).area() < 0.015 * region.area()


def test_rings_far_from_each_other_stay_apart() -> None:
    rings = [np.array([[0.0, 0], [9, 0], [9, 9], [0, 9]]) + np.array([apart, 0.0]) for apart in (0.0, 12.0)]
    assert len(merge_rings(rings, BEAD.step)) == 2
    assert len(merge_rings([rings[0], rings[0] + np.array([9 + 1.2 * BEAD.step, 0.0])], BEAD.step)) == 1


def test_a_ring_that_shrinks_to_a_place_is_not_joined() -> None:
    """It has no direction in which it could be; what is too short for a pass is said of the place."""
    row = Line(np.array([[0.0, 0.0], [5.0, 0.0]]), "row")
    place = Line(np.full((5, 2), 5.5) * [1.0, 0.0], "ring")
    assert [len(line.points) for line in join_all([place, row], None, BEAD)] == [2, 5]


def test_a_line_crosses_no_place() -> None:
    row = np.array([[0.0, 0.0], [5.0, 0.0]])
    assert not crosses(row, row[:0])
    assert not crosses(row[:1], row)
    assert crosses(row, np.array([[2.0, -1.0], [2.5, 1.0]]))
