"""The order of the passes of a layer."""

from __future__ import annotations

import numpy as np
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.fill.stripes import Bead
from damageest_paths.process.process import Pass, Process
from damageest_paths.tool.nozzle import Cone, make_nozzle
from damageest_paths.travel.order import order_passes
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import Floats, Mesh
from damageest.geometry.solids import to_arrays
from damageest.geometry.vectors import normalise

GAP = 0.2
NOZZLE = make_nozzle(Cone(0.5, 2.0, 25.0, 0.3))
PROCESS = Process(1.0, Bead(2.0, 1.4), "zigzag", 0.0, 0.0, 0.0, 1.0, GAP, 5, 1.0)


def make_pass(ends: Floats, axis: Floats) -> Pass:
    return Pass(ends, np.tile(normalise(axis[None]), (2, 1)), np.tile([0.0, 0, 1], (2, 1)), 0)


@given(st.integers(0, 10**6), st.integers(0, 9), st.booleans())
@settings(max_examples=40, deadline=None)
def test_each_pass_comes_once(seed: int, count: int, has_last: bool) -> None:
    rng = np.random.default_rng(seed)
    up = np.array([0.0, 0, 1])
    passes = [make_pass(rng.uniform(-10, 10, (2, 3)), up) for _ in range(count)]
    last = make_pass(np.eye(3)[:2], up) if has_last else None
    ordered = order_passes(passes, last, Clearance(NOZZLE, 2.0), PROCESS)
    wanted = sorted(sorted(map(tuple, one.points.tolist())) for one in passes)
    assert sorted(sorted(map(tuple, one.points.tolist())) for one in ordered) == wanted


def test_passes_on_one_side_of_a_wall_come_together() -> None:
    """The next pass on the same side is farther away than the one behind the wall."""
    wall = Mesh(*to_arrays(Manifold.cube((60, 1, 60)).translate((-30, -0.5, -1))))
    near = Obstacles([wall], np.array([-10.0, -4, 0]), np.array([10.0, 4, 2]), 1.0)
    passes = []
    for x in (-9.0, 9.0):
        for side in (-1.0, 1.0):
            ends = np.array([[x - 1, 2 * side, 0], [x + 1, 2 * side, 0]])
            passes.append(make_pass(ends, np.array([0.0, side, 1.0])))

    def count_changes(clearance: Clearance) -> int:
        sides = [float(np.sign(one.points[0, 1])) for one in order_passes(passes, None, clearance, PROCESS)]
        return int(np.count_nonzero(np.diff(sides)))

    assert count_changes(Clearance(NOZZLE, 2.0, near)) == 1
    assert count_changes(Clearance(NOZZLE, 2.0)) > 1
