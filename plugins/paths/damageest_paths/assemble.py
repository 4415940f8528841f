"""From a deposit to its path: parts, passes, moves, and the beads that result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import BeadFill, DepositPath, Floats, Mesh, Solid, Unreached
from damageest.geometry.simplification import simplify_within
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.geometry.transforms import turn_to_axis
from damageest_paths.beads import SHARE, Beads, simulate_beads
from damageest_paths.clearance import Clearance
from damageest_paths.directions import Planner, gather_missing, list_directions, plan_parts
from damageest_paths.exits import Travel
from damageest_paths.moves import Moves, find_corners, join_passes, rank_layers
from damageest_paths.nozzle import Nozzle
from damageest_paths.obstacles import COARSER, Obstacles, draw_passes
from damageest_paths.planar import Surroundings
from damageest_paths.process import Pass, Plan, Process
from damageest_paths.turning import divide_turns

MUCH_TRAVEL, MUCH_SURPLUS, MUCH_SUNK = 0.2, 0.1, 0.05
"""Shares from which a note says how much it is: travel, of the whole way; what is added beyond the deposit, and what
lies in intact metal, of the deposit."""
DETAIL = 0.01
"""Share of the bead's height or width by which the body that is sliced may differ from the deposit."""


@dataclass(frozen=True, eq=False)
class Task:
    """What a path is planned for: ``body``: the solid to build up; ``left``: what is left of the part, None for
    nothing; ``others``: other meshes that the nozzle must not touch. ``tolerance``: the job's."""

    body: Solid
    left: Solid | None
    others: Sequence[Mesh]
    tolerance: float


@dataclass(frozen=True)
class Speeds:
    """``feed``, ``fast``: lengths a minute. ``hop``: lift between passes; None: none where the way is free, else two
    bead widths. ``is_simulated``: whether the beads are."""

    feed: float
    fast: float
    hop: float | None
    is_simulated: bool


def plan_path(
    task: Task,
    nozzle: Nozzle,
    standoff: float,
    process: Process,
    speeds: Speeds,
    direction: Floats | None,
    planner: Planner,
) -> DepositPath:
    """The path that builds up a deposit.

    ``direction`` (3,): of the build; None: chosen.
    """
    origin: Floats = task.body.bounds.mean(axis=0)
    detail = DETAIL * min(process.bead.width, process.height)
    body = to_manifold(simplify_within(task.body, detail), origin)
    clearance = Clearance(nozzle, standoff, None, detail, beam=process.beam)
    around = Surroundings(_take_metal(task.left, origin), _shift(task.others, origin), clearance)
    directions = list_directions(task.body, task.left, task.tolerance) if direction is None else [direction]
    plans = plan_parts(body, origin, directions, around, process, planner)
    groups = [[_to_relative(one, plan) for one in plan.passes] for plan in plans]
    near = _gather_obstacles(groups, plans, around, task.body.bounds - origin, process)
    travel = _choose_travel(task, clearance, speeds, process, origin)
    moves = join_passes(groups, clearance.during_travel().with_obstacles(near), travel)
    missing = gather_missing(plans)
    solid = None if missing is None else to_solid(missing, origin)
    fill = _simulate(task, moves, plans, solid, origin, process) if speeds.is_simulated and len(moves.points) else None
    tightest = min((one for passes in groups for one in passes), key=lambda one: one.gap, default=None)
    path = DepositPath(
        moves.points + origin, moves.axes, moves.normals, moves.feed, moves.on, moves.layer, moves.number, moves.part,
        directions=np.array([plan.frame.direction for plan in plans]),
        heights=np.array([plan.height for plan in plans]),
        width=process.bead.width,
        section=np.array([plan.height * process.bead.step for plan in plans]),
        standoff=standoff,
        deposit_volume=task.body.volume,
        nozzle=nozzle.mesh,
        clearance=np.inf if tightest is None else tightest.gap,
        travel_clearance=moves.gap,
        tightest=_find_tightest(tightest, origin),
        unreached=_list_unreached(plans),
        missing=solid,
        fill=fill,
        kinds=moves.kinds,
        setup=_choose_setup(plans[0].frame.direction) if process.axes == 3 else None,
        around=np.append(origin + travel.centre, travel.safe),
        free_ends=moves.free_ends,
    )  # fmt: skip
    return _add_notes(path, moves, process)


def _choose_setup(direction: Floats) -> Floats:
    """The transform (4,4) into a frame about the same origin whose z is the build direction (3,)."""
    setup = np.eye(4)
    setup[:3, :3] = turn_to_axis(direction).T
    return setup


def _take_metal(left: Solid | None, origin: Floats) -> Any:
    """What is left of the part as a Manifold, empty for None. It is not simplified: the nozzle must not touch it."""
    from manifold3d import Manifold

    return Manifold() if left is None else to_manifold(left, origin)


def _shift(meshes: Sequence[Mesh], origin: Floats) -> list[Mesh]:
    return [Mesh(mesh.vertices - origin, mesh.faces) for mesh in meshes]


def _to_relative(one: Pass, plan: Plan) -> Pass:
    """A pass turned from the plan's local axes to those of the part, about the frame's origin; there the axis about z
    turns from pose to pose by little."""
    turn = plan.frame.turn
    tightest = None if one.tightest is None else (one.tightest[0] @ turn, one.tightest[1] @ turn)
    poses = divide_turns(one.points @ turn, one.axes @ turn, one.normals @ turn)
    return Pass(*poses, one.layer, one.gap, tightest, one.kind)


def _gather_obstacles(
    groups: Sequence[Sequence[Pass]], plans: Sequence[Plan], around: Surroundings, bounds: Floats, process: Process
) -> Obstacles:
    """What is left of the part and other meshes, and the beads of each layer with its rank."""
    meshes = [*around.others, *([] if around.metal.is_empty() else [Mesh(*to_arrays(around.metal))])]
    ranks = [0] * len(meshes)
    for (group, layer), rank in rank_layers(groups).items():
        own = [one for one in groups[group] if one.layer == layer]
        meshes.append(draw_passes(own, process.bead.width, plans[group].height))
        ranks.append(rank)
    return Obstacles(meshes, bounds[0], bounds[1], process.bead.width, ranks, coarser=COARSER)


def _find_tightest(one: Pass | None, origin: Floats) -> Floats | None:
    if one is None or one.tightest is None or not np.isfinite(one.gap):
        return None
    return np.array([one.tightest[0] + origin, one.tightest[1]])


def _choose_travel(task: Task, clearance: Clearance, speeds: Speeds, process: Process, origin: Floats) -> Travel:
    """The safe distance is that of the farthest corner of part, deposit and other meshes, and some beads more."""
    width = process.bead.width
    meshes = [task.body, *([task.left] if task.left else []), *task.others]
    vertices = np.concatenate([mesh.vertices for mesh in meshes]) - origin
    far = float(np.linalg.norm(vertices, axis=1).max())
    # beads stand out of the deposit by one width at most
    above = max(process.gap + width - clearance.standoff, 0.0)
    return Travel(
        2 * width if speeds.hop is None else speeds.hop, far + 10 * width, np.zeros(3), process.gap, speeds.feed,
        speeds.fast, find_corners(vertices), above, speeds.hop is None,
    )  # fmt: skip


def _simulate(
    task: Task, moves: Moves, plans: Sequence[Plan], missing: Solid | None, origin: Floats, process: Process
) -> BeadFill:
    ends = np.flatnonzero(moves.on)
    heights = np.array([plan.height for plan in plans])[moves.part[ends] - 1]
    beads = Beads(
        moves.points[ends - 1] + origin, moves.points[ends] + origin, moves.normals[ends],
        np.full(len(ends), process.bead.width), heights,
    )  # fmt: skip
    edge = min(process.bead.width, float(heights.min())) / SHARE
    return simulate_beads(beads, task.body, missing, task.left, plans[0].frame, edge)


def _list_unreached(plans: Sequence[Plan]) -> tuple[Unreached, ...]:
    last = plans[-1]
    return tuple(Unreached(volume, why) for why, volume in sorted(last.reasons.items()) if volume > 0)


def _describe_surplus(path: DepositPath) -> list[str]:
    """Notes on beads that add more than the deposit has, or lie in metal."""
    notes = []
    share = path.surplus_volume / path.deposit_volume
    if share > MUCH_SURPLUS:
        beside = "" if path.fill is None else f"; {path.fill.spill:.4g} lies beside the deposit"
        notes.append(
            f"the beads add {path.surplus_volume:.4g} ({share:.0%} of the deposit) more than what they fill{beside}: "
            "it is to be milled off; thinner layers and narrower beads add less"
        )
    if path.fill is not None and path.fill.sunk > MUCH_SUNK * path.deposit_volume:
        notes.append(
            f"beads lie in {path.fill.sunk:.4g} of intact metal ({path.fill.sunk / path.deposit_volume:.0%} of the "
            "deposit): a smaller path.penetration or thinner layers leave more of it"
        )
    return notes


def _add_notes(path: DepositPath, moves: Moves, process: Process) -> DepositPath:
    from dataclasses import replace

    notes = []
    share = path.unreached_volume / path.deposit_volume
    for item in path.unreached:
        if item.volume > 1e-6 * path.deposit_volume:
            notes.append(
                f"{item.volume:.4g} of the deposit ({item.volume / path.deposit_volume:.2%}) is not filled: {item.why}"
            )
    if share > 1e-3 and process.axes != 5:
        notes.append("more axes (path.axes: 5), another path.direction or a slimmer nozzle may reach more")
    notes += _describe_surplus(path)
    total = path.length + path.travel
    if total and path.travel > MUCH_TRAVEL * total:
        mean = path.length / max(path.passes, 1)
        notes.append(
            f"travel is {path.travel / total:.0%} of the length: {path.passes} passes of {mean:.3g} in the mean, each "
            "with a way there, down and up"
        )
    if moves.blocked:
        notes.append(
            f"for {moves.blocked} travels no way was found that keeps half of the gap; check them before you run them"
        )
    return replace(path, notes=tuple(notes))
