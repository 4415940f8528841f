"""From passes to the path of a deposit: the moves between them, and notes on what results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import DepositPath, Floats, Mesh
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.transforms import turn_to_axis
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import COARSER, Obstacles, draw_passes
from damageest_paths.drafts import MUCH_SUNK, Draft, Task
from damageest_paths.layering.planar import Surroundings
from damageest_paths.process.process import Pass, Plan, Process
from damageest_paths.travel.exits import Travel
from damageest_paths.travel.moves import Moves, find_corners, join_passes, rank_layers

MUCH_TRAVEL, MUCH_SURPLUS = 0.2, 0.1
"""Shares from which a note says how much it is: travel, of the whole way; what is added beyond the deposit, of the
deposit."""


@dataclass(frozen=True)
class Speeds:
    """``feed``, ``fast``: lengths a minute. ``hop``: lift between passes; None: none where the way is free, else two
    bead widths."""

    feed: float
    fast: float
    hop: float | None


def plan_moves(draft: Draft, speeds: Speeds) -> DepositPath:
    """The path of a draft: its passes with the moves between them."""
    task, process, plans, groups = draft.task, draft.process, draft.plans, draft.groups
    origin, clearance = draft.origin, draft.around.clearance
    near = _gather_obstacles(groups, plans, draft.around, task.body.bounds - origin, process)
    travel = _choose_travel(task, clearance, speeds, process, origin)
    moves = join_passes(groups, clearance.during_travel().with_obstacles(near), travel)
    tightest = min((one for passes in groups for one in passes), key=lambda one: one.gap, default=None)
    path = DepositPath(
        moves.points + origin, moves.axes, moves.normals, moves.feed, moves.on, moves.layer, moves.number, moves.part,
        directions=np.array([plan.frame.direction for plan in plans]),
        heights=np.array([plan.height for plan in plans]),
        width=process.bead.width,
        section=np.array([plan.height * process.bead.step for plan in plans]),
        standoff=clearance.standoff,
        deposit_volume=task.body.volume,
        nozzle=clearance.nozzle.mesh,
        clearance=np.inf if tightest is None else tightest.gap,
        travel_clearance=moves.gap,
        tightest=_find_tightest(tightest, origin),
        unreached=draft.unreached,
        missing=draft.missing,
        fill=draft.fill,
        kinds=moves.kinds,
        setup=_choose_setup(plans[0].frame.direction) if process.axes == 3 else None,
        around=np.append(origin + travel.centre, travel.safe),
        free_ends=moves.free_ends,
        layer_form=draft.layer_form,
    )  # fmt: skip
    noted = _add_notes(path, moves, process)
    return replace(noted, notes=(*noted.notes, draft.why)) if draft.why else noted


def _choose_setup(direction: Floats) -> Floats:
    """The transform (4,4) into a frame about the same origin whose z is the build direction (3,)."""
    setup = np.eye(4)
    setup[:3, :3] = turn_to_axis(direction).T
    return setup


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
        process.gap + width if process.axes == 5 else None,
    )  # fmt: skip


def describe_surplus(path: DepositPath) -> DepositPath:
    """The path with notes on beads that add more than the deposit has, or lie in metal."""
    notes = []
    share = path.surplus_volume / path.deposit_volume
    if share > MUCH_SURPLUS:
        beside = "" if path.fill is None else f"; {path.fill.spill:.4g} lies beside the deposit"
        notes.append(
            f"the beads add {path.surplus_volume:.4g} ({share:.0%} of the deposit) beyond what they fill{beside}: "
            "mill it off; thinner layers and narrower beads add less"
        )
    if path.fill is not None and path.fill.sunk > MUCH_SUNK * path.deposit_volume:
        notes.append(
            f"beads lie in {path.fill.sunk:.4g} of intact metal ({path.fill.sunk / path.deposit_volume:.0%} of the "
            "deposit); a smaller path.penetration or thinner layers keep more of it"
        )
    return replace(path, notes=(*path.notes, *notes))


def _describe_unreached(path: DepositPath) -> str:
    """How much is not filled, where the largest piece of it is, and why, on one line."""
    whole, place = path.deposit_volume, ""
    if path.missing is not None:
        largest = max(to_manifold(path.missing).decompose(), key=lambda piece: float(piece.volume()), default=None)
        if largest is not None:
            x, y, z = np.array(largest.bounding_box()).reshape(2, 3).mean(axis=0)
            place = f", the largest piece at ({x:.4g}, {y:.4g}, {z:.4g})"
    items = sorted(path.unreached, key=lambda item: -item.volume)
    reasons = [f"{item.volume / whole:.2%} {item.why}" for item in items if item.volume > 1e-4 * whole] or [
        items[0].why
    ]
    volume = path.unreached_volume
    return f"{volume:.4g} of the deposit ({volume / whole:.2%}) is not filled{place}: {'; '.join(reasons)}"


def _add_notes(path: DepositPath, moves: Moves, process: Process) -> DepositPath:
    notes = []
    share = path.unreached_volume / path.deposit_volume
    if share > 1e-6:
        notes.append(_describe_unreached(path))
    if share > 1e-3 and process.axes != 5:
        notes.append("more axes (path.axes: 5), another path.direction or a slimmer nozzle may reach more")
    total = path.length + path.travel
    if total and path.travel > MUCH_TRAVEL * total:
        mean = path.length / max(path.passes, 1)
        notes.append(
            f"travel is {path.travel / total:.0%} of the length: {path.passes} passes of {mean:.3g} in the mean, each "
            "with an approach and a retract; wider beads give fewer passes"
        )
    if moves.blocked:
        notes.append(f"for {moves.blocked} travels no way keeps half of the gap; check them before you run them")
    return replace(path, notes=tuple(notes))
