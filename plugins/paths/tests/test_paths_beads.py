"""The simulation of beads on voxels: it marks what lies in a bead, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_paths.beads import Beads, simulate_beads, stamp_beads
from damageest_paths.process.frames import make_frame
from hypothesis import example, given, settings
from hypothesis import strategies as st

from damageest.artefacts import Flags, Floats, Solid
from damageest.geometry.vectors import normalise
from tests.geometry.shapes import box

FRAME = make_frame((0.0, 0.0, 1.0), np.zeros(3))
WIDTH, HEIGHT, EDGE = 1.0, 0.5, 0.125


def draw_beads(count: int, longest: float, rng: np.random.Generator) -> Beads:
    """Beads in a row, along a line that winds, with tops that are not quite along it."""
    steps = rng.normal(size=(count, 3)) * [1, 1, 0.2]
    steps *= rng.uniform(0.01, longest, (count, 1)) / np.linalg.norm(steps, axis=1, keepdims=True)
    places = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    normals = normalise(rng.normal(size=(count, 3)) * 0.2 + [0, 0, 1])
    return Beads(places[:-1], places[1:], normals, np.full(count, WIDTH), np.full(count, HEIGHT))


def mark_one_by_one(beads: Beads, low: Floats, size: tuple[int, int, int]) -> Flags:
    """Which voxels lie below the top of a bead by its height at most, and beside its line by half its width at most."""
    places = FRAME.to_part(low + (np.argwhere(np.ones(size, bool)) + 0.5) * EDGE)
    found = np.zeros(len(places), bool)
    for start, stop, normal in zip(beads.start, beads.stop, beads.normal, strict=True):
        along = stop - start
        length = float(np.linalg.norm(along))
        share = np.clip((places - start) @ along / length, 0, length) / length
        away = places - start - share[:, None] * along
        up = away @ normal
        across = (away**2).sum(axis=1) - up**2
        found |= (up <= 1e-9) & (up >= -HEIGHT - 1e-9) & (across <= WIDTH**2 / 4 + 1e-9)
    return found.reshape(size)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 6), st.floats(0.05, 4.0), st.integers(0, 2**32 - 1))
@example(2, 2.71875, 28)
def test_a_voxel_is_marked_where_its_middle_lies_in_a_bead(count: int, longest: float, seed: int) -> None:
    beads = draw_beads(count, longest, np.random.default_rng(seed))
    ends = FRAME.to_local(np.concatenate([beads.start, beads.stop]))
    low = ends.min(axis=0) - 1.5
    nx, ny, nz = (int(n) for n in np.ceil((ends.max(axis=0) + 1.5 - low) / EDGE))
    marked = stamp_beads(beads, FRAME, low, (nx, ny, nz), EDGE)
    assert np.array_equal(marked, mark_one_by_one(beads, low, (nx, ny, nz)))


def test_the_largest_gap_is_as_wide_as_it_is() -> None:
    """A bead along the middle of a block leaves a gap on either side, the wider one 2 wide."""
    block = box((8.0, 4.5, HEIGHT))
    top = float(block.bounds[1, 2])
    line = np.array([[-3.5, -0.25, top], [3.5, -0.25, top]])
    beads = Beads(line[:1], line[1:], np.array([[0.0, 0, 1]]), np.array([WIDTH]), np.array([HEIGHT]))
    fill = simulate_beads(beads, Solid(block.vertices, block.faces), None, None, FRAME, EDGE)
    assert fill.filled == pytest.approx(8 * 1.0 / (8 * 4.5), abs=0.02)
    assert fill.void == pytest.approx(HEIGHT, abs=EDGE), "the block is not higher than that"
    assert fill.largest_gap == pytest.approx(2.0 * 8 * HEIGHT, rel=0.3)


@pytest.mark.parametrize("air", [0.0, 0.3])
def test_the_air_below_the_first_beads_is_measured_and_not_that_below_others(air: float) -> None:
    """Two layers of a wall on a block, the first one above it by some air."""
    block = box((8.0, 4.5, 2.0))
    top = float(block.bounds[1, 2])
    heights = top + air + HEIGHT * np.array([1, 2])
    start, stop = (np.column_stack([np.full((2, 2), [side, 0.0]), heights]) for side in (-3.0, 3.0))
    beads = Beads(start, stop, np.tile([0.0, 0, 1], (2, 1)), np.full(2, WIDTH), np.full(2, HEIGHT))
    deposit = box((6.0, 1.0, 2.0))
    deposit = Solid(np.add(deposit.vertices, [0, 0, top + 1.0]), deposit.faces)
    fill = simulate_beads(beads, deposit, None, block, FRAME, EDGE)
    assert fill.air == pytest.approx(air, abs=1e-6)
    assert fill.air_95 == pytest.approx(air, abs=1e-6)
