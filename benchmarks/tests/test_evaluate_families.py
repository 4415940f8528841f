"""Families of scans drawn at random: the truth of a draw is what its scan shows."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.families.case import FAMILIES, FamilyCase
from damageest_benchmarks.families.report import describe_row, make_family_cases, make_family_table
from damageest_benchmarks.families.scene import Draw

from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.transforms import move_points


def measure_off(draw: Draw) -> np.ndarray:
    """Distance of each point from the part's skin, in the true pose."""
    assert draw.pose is not None
    return distance_to_mesh(move_points(draw.scan.points, draw.pose), draw.part)


@pytest.mark.variants(1)
@pytest.mark.parametrize("seed", [0, 12, 15, 24])
def test_a_wall_is_scanned_where_it_is_left(seed: int) -> None:
    draw = FAMILIES["walls"][1](seed)
    assert draw.damage is not None
    off, depth, wall = measure_off(draw), float(draw.said["depth"]), float(draw.said["wall"])
    assert off.max() < depth + 2 * draw.tolerance  # as deep as the pit, with noise
    assert off.max() > 0.7 * min(depth, wall / 2)  # beyond half of the wall its other side is nearer
    assert 0.15 <= depth / wall <= 0.95


def test_a_pit_that_was_scanned_from_behind_was_not_seen() -> None:
    draw = FAMILIES["walls"][1](16)
    assert draw.said["side"] == "inside"
    assert not draw.shown
    assert measure_off(draw).max() < 2 * draw.tolerance


@pytest.mark.parametrize(("seed", "fits"), [(0, True), (7, False)])
def test_a_mirrored_part_fits_only_after_a_reflection(seed: int, fits: bool) -> None:
    draw = FAMILIES["hands"][1](seed)
    assert draw.said["hand"] == ("proper" if fits else "mirrored")
    assert (draw.pose is not None) == fits
    if draw.pose is not None:
        assert measure_off(draw).max() < 2 * draw.tolerance


@pytest.mark.parametrize(("seed", "seen"), [(4, True), (11, False)])
def test_a_feature_tells_the_angle_where_it_was_seen(seed: int, seen: bool) -> None:
    """Turned by half a turn about its axis, the scan fits the part only if its feature was not seen."""
    draw = FAMILIES["turned"][1](seed)
    assert draw.shown == seen
    assert measure_off(draw).max() < 2 * draw.tolerance
    lug = draw.part.vertices[np.argmax(np.hypot(*draw.part.vertices[:, :2].T))]
    assert draw.pose is not None
    gap = np.linalg.norm(move_points(draw.scan.points, draw.pose) - lug, axis=1).min()
    assert (gap < 10 * draw.tolerance) == seen


@pytest.mark.parametrize("seed", range(4))
def test_datums_lie_on_the_scan_as_it_is(seed: int) -> None:
    """Worn all over, datum A still is where the part lies; worn in part, the rest of it is."""
    draw = FAMILIES["datums"][1](seed)
    assert draw.pose is not None
    assert draw.damage is not None
    placed = move_points(draw.scan.points, draw.pose)
    bottom = placed[np.abs(placed[:, 2]) < draw.tolerance, 2]
    assert len(bottom) > 2000
    assert bottom.mean() == pytest.approx(0, abs=draw.tolerance / 10)
    if draw.said["state"] in ("others worn", "datum worn"):
        assert placed[:, 2].max() < draw.part.bounds[1, 2] - draw.tolerance


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 6])
def test_a_part_on_a_table_lies_on_its_earlier_scan_where_nothing_is_lost(seed: int) -> None:
    draw = FAMILIES["surroundings"][1](seed)
    assert draw.pose is not None
    assert draw.damage is not None
    placed = move_points(draw.scan.points, draw.pose)
    middle = draw.damage.bounds.mean(axis=0)
    radius = (3 * draw.damage.volume / np.pi) ** (1 / 3)
    gap = np.linalg.norm(placed - middle, axis=1)
    assert gap.min() > 0.25 * radius
    off, face, _ = closest_on_mesh(placed[(gap > 1.5 * radius) & (gap < 3 * radius)], draw.part)
    assert draw.part.unseen is not None
    off = off[~draw.part.unseen[face]]
    assert len(off) > 200
    assert np.median(off) < draw.tolerance  # the later table is near too


def test_equal_seeds_give_equal_scans() -> None:
    first, second = FAMILIES["hands"][1](3), FAMILIES["hands"][1](3)
    assert np.array_equal(first.scan.points, second.scan.points)
    assert not np.array_equal(first.scan.points, FAMILIES["hands"][1](4).scan.points)


def test_cases_are_drawn_evenly_and_counted_by_group() -> None:
    cases = make_family_cases((), 10, (), "source")
    assert len(cases) == 50
    assert len({case.compute_key() for case in cases}) == 50
    rows = [case.make_blank_row() | {"said": {"side": "both"}} for case in cases if case.family == "walls"]
    rows[0] |= {"outcome": "right", "comes_out": True, "holds": True, "accepted": 1, "sites": 1}
    table = make_family_table(rows)
    assert table[1][:6] == ["walls", "all", "30", "29", "30", "1"]
    assert describe_row(FamilyCase("walls", 3).make_blank_row()).startswith("walls 3: SILENT")
