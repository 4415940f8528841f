"""What the layers of a deposit fill and leave, before the moves between their passes are planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import BeadFill, Floats, Mesh, Solid, Unreached
from damageest.geometry.simplification import simplify_within
from damageest.geometry.solids import to_manifold, to_solid
from damageest_paths.beads import SHARE, Beads, simulate_beads
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.turning import divide_turns
from damageest_paths.holding.reach import is_reached
from damageest_paths.layering.directions import Planner, gather_missing, list_directions, plan_parts
from damageest_paths.layering.planar import Surroundings
from damageest_paths.process.process import Pass, Plan, Process
from damageest_paths.tool.nozzle import Nozzle

MUCH_SUNK = 0.05
"""Share of the deposit from which what of the beads lies in intact metal is much."""
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


@dataclass(frozen=True, eq=False)
class Draft:
    """The passes of a path, without the moves between them: these take long to plan, and nothing else depends on them.

    ``origin`` (3,): that the plans, and what is ``around``, are relative to. ``missing``: what is not filled; ``fill``:
    what the beads do, None where they are not simulated.
    ``layer_form``: see `DepositPath`. ``why``: it was taken, where another was tried.
    """

    task: Task
    process: Process
    origin: Floats
    around: Surroundings
    plans: Sequence[Plan]
    groups: Sequence[Sequence[Pass]]
    missing: Solid | None
    fill: BeadFill | None
    layer_form: str = ""
    why: str = ""

    @property
    def is_empty(self) -> bool:
        return not any(self.groups)

    @property
    def width(self) -> float:
        """Of a bead."""
        return self.process.bead.width

    @property
    def deposit_volume(self) -> float:
        return self.task.body.volume

    @property
    def unreached(self) -> tuple[Unreached, ...]:
        reasons = self.plans[-1].reasons
        return tuple(Unreached(volume, why) for why, volume in sorted(reasons.items()) if volume > 0)

    @property
    def unreached_volume(self) -> float:
        return sum(item.volume for item in self.unreached)


def draft_path(
    task: Task,
    nozzle: Nozzle,
    standoff: float,
    process: Process,
    is_simulated: bool,
    direction: Floats | None,
    planner: Planner,
) -> Draft:
    """The passes that build up a deposit.

    ``direction`` (3,): of the build; None: chosen.
    """
    origin: Floats = task.body.bounds.mean(axis=0)
    detail = DETAIL * min(process.bead.width, process.height)
    body = to_manifold(simplify_within(task.body, detail), origin)
    clearance = Clearance(nozzle, standoff, None, detail, beam=process.beam)
    around = Surroundings(_take_metal(task.left, origin), _shift(task.others, origin), clearance)
    directions = list_directions(task.body, task.left, task.tolerance) if direction is None else [direction]
    directions = [one for one in directions if is_reached(one[None], process.reach).all()] or directions
    plans = plan_parts(body, origin, directions, around, process, planner)
    groups = [[_to_relative(one, plan) for one in plan.passes] for plan in plans]
    missing = gather_missing(plans)
    solid = None if missing is None else to_solid(missing, origin)
    fill = _simulate(task, groups, plans, solid, origin, process) if is_simulated and any(groups) else None
    return Draft(task, process, origin, around, plans, groups, solid, fill)


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


def _simulate(
    task: Task,
    groups: Sequence[Sequence[Pass]],
    plans: Sequence[Plan],
    missing: Solid | None,
    origin: Floats,
    process: Process,
) -> BeadFill:
    passes = [(one, plan.height) for group, plan in zip(groups, plans, strict=True) for one in group]
    heights = np.concatenate([np.full(len(one.points) - 1, height) for one, height in passes])
    beads = Beads(
        np.concatenate([one.points[:-1] for one, _ in passes]) + origin,
        np.concatenate([one.points[1:] for one, _ in passes]) + origin,
        np.concatenate([one.normals[1:] for one, _ in passes]),
        np.full(len(heights), process.bead.width),
        heights,
    )
    edge = min(process.bead.width, float(heights.min())) / SHARE
    return simulate_beads(beads, task.body, missing, task.left, plans[0].frame, edge)
