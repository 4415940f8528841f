"""The tool turns over a break of a pass, where it is free to."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from damageest_paths.clearance.axes import list_axes
from damageest_paths.clearance.bridging import FARTHEST, list_bridges
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Flags, Floats
from tests.path_shapes import BLOCK, Loss, cut, plan

AXES = list_axes(np.radians(60))
LINE = np.column_stack([np.linspace(0, 20, 81), np.zeros(81), np.zeros(81)])
RATE = np.radians(10.0)


def break_at(*places: int, wide: int = 1) -> Flags:
    goes_on = np.ones(80, bool)
    for place in places:
        goes_on[place : place + wide] = False
    return goes_on


def hold(*stretches: tuple[int, int]) -> Floats:
    """Axes along the line: of each number up to a point."""
    return np.concatenate([np.tile(AXES[number], (count, 1)) for number, count in stretches])


@pytest.mark.parametrize(("longer", "place"), [(1.0, 0.5), (2.0, 0.1), (2.0, 0.9)])
def test_the_tool_turns_evenly_over_a_break(longer: float, place: float) -> None:
    (bridge,) = list_bridges(3, LINE, hold((0, 41), (1, 40)), break_at(40), RATE, (longer, place))
    assert bridge.number == 3
    assert bridge.start <= 40 < 41 < bridge.stop
    assert np.allclose(bridge.axes[[0, -1]], AXES[:2])
    turns = np.arccos(np.clip((bridge.axes[1:] * bridge.axes[:-1]).sum(axis=1), -1, 1))
    assert np.ptp(turns) < 1e-9
    assert turns.max() <= RATE * 0.25 + 1e-9
    # 20 degrees at 10 a millimetre take 2 mm, 8 points
    assert bridge.stop - bridge.start == pytest.approx(8 * longer, abs=3)


def test_no_turn_where_there_is_no_room_or_it_is_far() -> None:
    axes = hold((0, 41), (1, 40))
    assert not list_bridges(0, LINE, axes, break_at(40), RATE / 20, (1.0, 0.5))
    assert not list_bridges(0, LINE, axes, break_at(37, 40, 43), RATE, (1.0, 0.5))
    assert not list_bridges(0, LINE, axes, break_at(0), RATE, (1.0, 0.5))
    far = np.array([[np.sin(FARTHEST + 0.1), 0, np.cos(FARTHEST + 0.1)]])
    assert not list_bridges(0, LINE, np.concatenate([axes[:41], np.tile(far, (40, 1))]), break_at(40), RATE, (1, 0.5))


@given(st.lists(st.integers(0, 79), max_size=6), st.integers(1, 5), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_bridges_do_not_overlap_and_keep_within_two_breaks(places: list[int], wide: int, seed: int) -> None:
    goes_on = break_at(*places, wide=wide)
    number = np.cumsum(np.append(0, ~goes_on)) % 3
    axes = AXES[np.random.default_rng(seed).permutation(len(AXES))[number]]
    for shape in ((1.0, 0.5), (2.0, 0.9)):
        last = 0
        for bridge in list_bridges(0, LINE, axes, goes_on, 3 * RATE, shape):
            assert bridge.start >= last
            last = bridge.stop - 1
            assert last < len(LINE)
            broken = np.flatnonzero(~goes_on[bridge.start : last])
            assert len(broken)
            assert np.ptp(broken) == len(broken) - 1


def plan_pocket() -> tuple[Loss, DepositPath]:
    pocket = cut(BLOCK, Manifold.cylinder(8, 7, 7, 48).translate((0, 0, -4)))
    fat = {"tip_radius": 1.6, "cone_angle": 35.0, "length": 60.0, "body_radius": 12.0}
    return pocket, plan(pocket, direction=(0, 0, 1), axes=5, nozzle=fat, simulate=False)


def test_a_ring_beside_the_wall_of_a_pocket_is_one_pass() -> None:
    """The tool leans from the wall all round; it stopped at each of eight axes."""
    _, path = plan_pocket()
    assert path.passes == path.layers == 4
    assert path.unreached_volume < 0.001 * path.deposit_volume


@pytest.mark.slow
def test_the_tool_keeps_clear_where_it_turns_over_a_break() -> None:
    pocket, path = plan_pocket()
    assert measure_nozzle(path, pocket.left, 0.05) > 0
