"""Ways between passes where something stands in between."""

from __future__ import annotations

import numpy as np
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.process.process import Pass
from damageest_paths.tool.nozzle import Cone, make_nozzle
from damageest_paths.travel.exits import Travel
from damageest_paths.travel.moves import join_passes
from damageest_paths.travel.network import measure_way
from manifold3d import Manifold

from damageest.artefacts import Floats, Mesh
from damageest.geometry.solids import to_arrays
from damageest.geometry.vectors import normalise

GAP, HOP = 0.5, 1.0


def make_pass(start: float, stop: float, y: float, lean: float) -> Pass:
    """A pass along x, the tool leaning along y."""
    points = np.column_stack([np.linspace(start, stop, 9), np.full(9, y), np.zeros(9)])
    axis = normalise(np.array([[0.0, lean, 1.0]]))
    return Pass(points, np.tile(axis, (9, 1)), np.tile([0.0, 0.0, 1.0], (9, 1)), 0)


def join(height: float) -> tuple[Floats, Floats, Clearance]:
    """Points and axes from the end of a pass at one side of a post to the start of the next at the other side."""
    block = Manifold.cube((80, 40, 10)).translate((-40, -20, -11)) + Manifold.cylinder(height + 1, 1.5).translate(
        (0, 0, -1)
    )
    obstacles = Obstacles([Mesh(*to_arrays(block))], np.array([-16.0, -4, 0]), np.array([16.0, 4, 0]), 1.0)
    clearance = Clearance(make_nozzle(Cone(1.0, 3.0, 25.0, 0.4)), 3.0, obstacles).during_travel()
    travel = Travel(HOP, 200.0, np.zeros(3), GAP, 10.0, 20.0, np.array([[0.0, 0.0, 150.0]]), 0.0)
    moves = join_passes([[make_pass(-16, 0, -4, -0.3), make_pass(0, 16, 4, 0.3)]], clearance, travel)
    assert moves.blocked == 0
    own = np.flatnonzero(moves.on & (moves.number == 1))[-1], np.flatnonzero(moves.on & (moves.number == 2))[0]
    between = slice(own[0], own[1])
    return moves.points[between], moves.axes[between], clearance


def test_the_tool_goes_round_a_post_near_the_passes() -> None:
    """The other ways lead over the post, 150 high, or round a sphere of 50 and more."""
    points, axes, clearance = join(150.0)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert 16 < length < 60
    share = np.linspace(0, 1, 60)[:, None]
    for k in range(len(points) - 1):
        places = points[k] + share * (points[k + 1] - points[k])
        turned = normalise(axes[k] + share * (axes[k + 1] - axes[k]))
        assert min(clearance.measure(*pose) for pose in zip(places, turned, strict=True)) >= GAP / 2 - 0.05


def test_without_a_post_the_way_is_straight() -> None:
    points, _, _ = join(0.1)
    assert float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) < 14


def test_a_tool_that_turns_far_is_clear_where_it_keeps_its_gap() -> None:
    """Between two walls, upright to 60 degrees over; it turns fastest half way."""
    walls = Manifold.cube((40, 40, 40)).translate((1.6, -20, -20)) + Manifold.cube((40, 40, 40)).translate(
        (-41.6, -20, -20)
    )
    obstacles = Obstacles([Mesh(*to_arrays(walls))], np.array([-2.0, -20, 0]), np.array([2.0, 20, 30]), 1.0)
    nozzle = make_nozzle(Cone(1.0, 1.0, 25.0, 0.4))
    clearance = Clearance(nozzle, 3.0, obstacles).during_travel()
    axes = normalise(np.array([[0.0, 0.0, 1.0], [0.0, 3.0, 1.0]]))
    least = min(
        clearance.measure(np.zeros(3), normalise((1 - s) * axes[0] + s * axes[1])) for s in np.linspace(0, 1, 200)
    )
    for gap in (0.5 * least, 0.9 * least):
        assert gap / 2 <= measure_way(np.zeros((2, 3)), axes, clearance, gap) <= least + 1e-9
    assert measure_way(np.zeros((2, 3)), axes, clearance, 2.1 * least) < 1.05 * least
