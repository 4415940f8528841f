"""Patterns: what they cover, and that passes cross nothing."""

from __future__ import annotations

from itertools import combinations
from typing import Any, get_args

import numpy as np
import pytest
from damageest_paths.fill.fill import fill_region, list_lines
from damageest_paths.fill.joints import drop_spurs, end_at_reversals, find_reversals, round_corners
from damageest_paths.fill.regions import cover, list_pieces, make_region, measure_length
from damageest_paths.fill.stripes import Bead
from damageest_paths.fill.trim import lengthen_line
from damageest_paths.fill.weave import Pattern
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection

from damageest.artefacts import Floats

BEAD = Bead(1.0, 0.7)


def make_star() -> Any:
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    radius = 6 + 2 * np.cos(5 * angle)
    return make_region([np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])])


REGIONS = {
    "disc": CrossSection.circle(5, 64),
    "ring": CrossSection.circle(6, 64) - CrossSection.circle(2.5, 64),
    "star": make_star(),
    "thin": CrossSection.square((12, 0.4)),
    "two": CrossSection.square((4, 4)) + CrossSection.square((3, 2)).translate((8, 1)),
    "L": CrossSection.square((9, 3)) + CrossSection.square((3, 9)),
}


@pytest.mark.parametrize("pattern", get_args(Pattern))
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "star" else n for n in REGIONS])
def test_beads_cover_the_region_and_little_else(name: str, pattern: Pattern) -> None:
    region = REGIONS[name]
    lines = fill_region(region, pattern, BEAD, 0.4)
    covered = cover(lines, BEAD.width)
    # a round corner leaves a tenth of the square of a bead's width
    gaps = (region - covered).offset(-0.02 * BEAD.width)
    assert gaps.area() <= (0.035 if name in ("two", "L") else 0.005) * region.area()
    assert max((gap.area() for gap in gaps.decompose()), default=0) <= 0.1 * BEAD.width**2
    assert not any(find_reversals(line, BEAD.width) for line in lines)
    assert (covered - region.offset(BEAD.width)).area() <= 1e-6


def measure_turns(line: Floats) -> Floats:
    """The turns of a line in degrees, between the first points of its stretches of a tenth of a bead's width."""
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    sides = np.diff(line[np.unique(np.floor(way / (0.1 * BEAD.width)), return_index=True)[1]], axis=0)
    unit = sides / np.linalg.norm(sides, axis=1)[:, None]
    return np.asarray(np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", unit[1:], unit[:-1]), -1, 1))))


def make_blob(rng: np.random.Generator) -> Any:
    """A region with a wavy border, long or round."""
    angle, number = np.linspace(0, 2 * np.pi, 90, endpoint=False), np.arange(1, 9)[:, None]
    waves = rng.uniform(-0.3, 0.3, (8, 1)) / number * np.cos(number * angle + rng.uniform(0, 6, (8, 1)))
    radius = np.maximum(rng.uniform(2, 6) * (1 + waves.sum(axis=0)), 0.3)
    return make_region([np.column_stack([radius * np.cos(angle), rng.uniform(0.3, 1) * radius * np.sin(angle)])])


@pytest.mark.parametrize("seed", [11, 47, 91, 106])
def test_no_pass_comes_back_on_itself_where_metal_is_in_the_way(seed: int) -> None:
    """Lines that are moved aside from metal had hooks, and rings one where they close."""
    rng = np.random.default_rng(seed)
    region = make_blob(rng)
    free = region.offset(0.2)
    for _ in range(3):
        free -= make_blob(rng).scale((0.15, 0.15)).translate(tuple(rng.uniform(-4, 4, 2)))
    lines = list_lines(region, "zigzag", BEAD, float(rng.uniform(0, 3)), free, 0.5, region)
    assert lines
    assert all(measure_turns(line.points).max(initial=0.0) < 150 for line in lines if len(line.points) > 2)


def test_a_closed_line_with_round_corners_ends_where_it_begins() -> None:
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]], float)
    line = round_corners(square, BEAD.width)
    assert np.allclose(line[0], line[-1])
    assert measure_turns(line).max() < 90
    assert measure_turns(np.concatenate([line, line[1:4]])).max() < 90


def test_a_short_line_becomes_a_pass_where_there_is_room() -> None:
    room, line = CrossSection.square((4, 2), True), np.array([[-0.2, 0.0], [0.0, 0.05], [0.2, 0.0]])
    longer = lengthen_line(line, 0.8, room, room, BEAD.width)
    assert measure_length(longer) == pytest.approx(0.8)
    assert np.allclose(longer.mean(axis=0), 0)
    assert lengthen_line(line, 0.8, room, CrossSection.square((0.5, 0.5), True), BEAD.width) is line


def test_a_spur_is_left_out() -> None:
    line = np.array([[0, 0], [3, 0], [3.1, 0.01], [3, 0.02], [3, 3]], float)
    assert drop_spurs(line, BEAD.width).tolist() in ([[0, 0], [3, 0], [3, 3]], [[0, 0], [3, 0], [3, 0.02], [3, 3]])
    long = np.array([[0, 0], [3, 0], [1, 0.1]], float)
    assert len(end_at_reversals(long, BEAD.width)) == 2


def count_crossings(line: Floats, other: Floats) -> int:
    """How many sides of one polyline properly cross sides of another."""
    a, b, c, d = line[:-1, None], line[1:, None], other[None, :-1], other[None, 1:]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        return np.asarray((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    apart = 1e-9
    across = (side(a, b, c) * side(a, b, d) < -apart) & (side(c, d, a) * side(c, d, b) < -apart)
    return int(across.sum())


@pytest.mark.parametrize("pattern", get_args(Pattern))
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "star" else n for n in REGIONS])
def test_no_pass_crosses_itself(name: str, pattern: Pattern) -> None:
    for line in fill_region(REGIONS[name], pattern, BEAD, 0.4):
        assert count_crossings(line, line) == 0


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n == "star" else n for n in REGIONS])
def test_rows_of_a_zigzag_cross_no_other(name: str) -> None:
    lines = fill_region(REGIONS[name], "zigzag", BEAD, 0.4)
    assert sum(count_crossings(a, b) for a, b in combinations(lines, 2)) == 0


def test_a_convex_region_is_one_pass() -> None:
    assert len(fill_region(REGIONS["disc"], "zigzag", BEAD, 0.0)) == 1
    assert len(fill_region(REGIONS["disc"], "spiral", BEAD, 0.0)) <= 2, "and a dab in the middle"


def test_rows_follow_the_angle() -> None:
    (line,) = fill_region(CrossSection.square((10, 6)), "zigzag", BEAD, np.pi / 2)
    sides = np.abs(np.diff(line, axis=0))
    assert sides[sides[:, 0] < 1e-9, 1].sum() > 0.75 * measure_length(line)


def test_a_long_region_has_one_pass_along_it() -> None:
    """Whatever the angle of the layer is: never to and fro across a narrow web."""
    (line,) = [line.points for line in list_lines(CrossSection.square((20, 3)), "zigzag", BEAD, np.pi / 2)]
    sides = np.abs(np.diff(line, axis=0))
    assert sides[:, 0].sum() > 0.85 * measure_length(line)


def test_nothing_for_nothing() -> None:
    assert fill_region(CrossSection(), "zigzag", BEAD, 0.0) == []


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=3, max_size=6),
    st.floats(1e-9, 1e-3),
    st.floats(0, 3),
)
def test_rows_of_slivers_stay_near_them(corners: list[tuple[float, float]], flat: float, angle: float) -> None:
    """Pieces that vanish where they are cut have no bounds; a row through them would be endless."""
    region = make_region([np.array(corners) * [1.0, flat]]) + CrossSection.square((3, 3))
    for line in fill_region(region, "zigzag", BEAD, angle):
        assert np.abs(line).max() < 10
    assert not list_pieces(CrossSection())


@pytest.mark.parametrize("angle", [0.0, np.pi / 2])
def test_a_strip_narrower_than_half_a_bead_beside_a_wall_is_covered(angle: float) -> None:
    """Where it is held, the middle of a bead may lie a little beside the strip, but not nearer to the wall than half a
    bead."""
    region = CrossSection.square((6, 0.46))
    free = CrossSection.square((5.0, 0.1)).translate((0.5, 0.48))
    lines = [line.points for line in list_lines(region, "zigzag", BEAD, angle, free, 0.0, free)]
    assert (region - cover(lines, BEAD.width)).area() < 0.05 * region.area()
    assert sum(measure_length(line) for line in lines) < 6  # not there and back
    assert not list_lines(region, "zigzag", BEAD, angle, free)
    for line in lines:
        assert (cover([line], 1e-3) - free).area() < 1e-3


FREE = [
    (0.83, 0.0), (1.07, 0.44), (1.03, 0.52), (0.98, 0.93), (0.85, 1.37), (0.7, 1.59), (0.42, 1.75), (-0.08, 1.71),
    (-0.5, 1.61), (-1.35, 1.51), (-0.42, 1.49), (-0.27, 1.44), (-0.15, 1.35), (-0.05, 1.24), (0.01, 1.1), (0.04, 0.95),
    (-0.01, 0.69), (-0.03, 0.36), (0.01, 0.27), (0.18, 0.15), (0.4, -0.05), (0.62, -0.15),
]  # fmt: skip
REGION = [
    (0.49, -0.18), (1.47, 0.28), (1.59, 0.74), (1.55, 1.1), (1.34, 1.71), (1.16, 1.96), (0.99, 2.11), (0.57, 2.32),
    (0.42, 2.34), (-0.13, 2.3), (-0.58, 2.2), (-1.35, 2.12), (-1.65, 2.03), (-1.77, 1.93), (-1.86, 1.81), (-1.92, 1.66),
    (-1.94, 1.51), (-1.92, 1.35), (-1.86, 1.21), (-1.76, 1.09), (-1.64, 1.0), (-1.49, 0.94), (-1.31, 0.92),
    (-1.14, 0.96), (-1.13, 0.92), (-0.56, 0.91), (-0.6, 0.74), (-0.62, 0.28), (-0.48, -0.07), (-0.11, -0.39),
]  # fmt: skip
"""Where the middle of a bead 1.2 wide may lie in a layer of a bearing's housing, which ends in a tip, and what such
beads cover of the deposit."""


def test_a_tapering_tip_of_the_free_region_is_covered() -> None:
    bead, free, region = Bead(1.2, 0.84), make_region([np.array(FREE)]), make_region([np.array(REGION)])
    lines = [line.points for line in list_lines(region, "zigzag", bead, 0.0, free, 0.6, region)]
    tip = region - CrossSection.square((6, 6)).translate((-1, -2))
    assert (tip - cover(lines, bead.width)).area() < 0.1 * tip.area()
    for line in lines:
        assert (cover([line], 1e-3) - free).area() < 1e-3


def test_a_strip_between_a_hole_and_metal_is_covered() -> None:
    """The middle of a bead may lie on 0.01 only, between what metal keeps it from and a hole of the region."""
    hole = CrossSection.square((2.5, 2.5)).translate((0.51, 2.0))
    region = CrossSection.square((6, 7)) - hole
    free = CrossSection.square((5, 6)).translate((0.5, 0.5)) - hole.offset(-0.1)
    lines = [line.points for line in list_lines(region, "zigzag", BEAD, np.pi / 2, free, 0.5, region)]
    strip = CrossSection.square((0.51, 2.5)).translate((0, 2.0))
    assert (strip - cover(lines, BEAD.width)).area() < 0.05 * strip.area()
