"""Build directions that are tried, and the deposit cut into parts with a direction each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.distance import distance_to_mesh
from damageest_paths.clearance.obstacles import draw_passes
from damageest_paths.layering.conformal import LOST, plan_conformal
from damageest_paths.layering.planar import SUNK, Surroundings, plan_planar
from damageest_paths.layering.unfilled import BESIDE
from damageest_paths.process.frames import Frame, make_frame, make_unit
from damageest_paths.process.process import Plan, Process

ENOUGH = 1e-3
"""Share of a body's volume below which what is missing is not worth another direction."""
LITTLE = 0.05
"""The same for layers along a floor."""
NO_REASON = {SUNK: 0.1, BESIDE: 0.01}
"""Shares of a body's volume up to which what is missing for a reason asks for no other direction: what is too thin
over metal for a bead is so with all of them, and layers along the floor follow it with each."""
MOST_PARTS, MOST_DIRECTIONS = 4, 6
MOST_LEFT = 0.9
"""Share of what is missing that another plan may leave."""
COARSE = 2.0
"""Factor of layer height and bead width for the trials of directions."""
ROUGH = 0.1
"""Share of the layer height within which the body is simplified for these trials."""
CLEARLY = 0.5
"""Share of what layers along a floor lose with the first direction, up to which planes may lose with another so that
layers along the floor are planned for that one."""
CLEARLY_WORSE = 0.002
"""Share of a body's volume by which a trial has to lose more than the best one for it to be given up."""
ALIKE = np.cos(np.radians(5.0))
Planner = Callable[[Any, Frame, Surroundings, Process], Plan]


def find_open_normal(deposit: Mesh, metal: Mesh | None, tolerance: float) -> Floats:
    """Mean outward normal (3,) of the faces of a deposit that do not lie on metal; of all upward ones where that is 0.

    ``tolerance``: faces nearer to the metal than that lie on it.
    """
    centre, area = deposit.triangles.mean(axis=1), 2 * deposit.face_areas
    is_open = np.ones(len(centre), bool) if metal is None else distance_to_mesh(centre, metal) > tolerance
    total = deposit.cross[is_open].sum(axis=0)
    if np.linalg.norm(total) <= 1e-6 * area.sum():
        return np.array([0.0, 0.0, 1.0])
    return make_unit(total)


def list_directions(deposit: Mesh, metal: Mesh | None, tolerance: float) -> list[Floats]:
    """Build directions (3,) worth a trial: the mean normal of the open faces, the normals of large open planes, and
    the axes of the part's frame both ways; those that point into the open first."""
    main = find_open_normal(deposit, metal, tolerance)
    centre = deposit.triangles.mean(axis=1)
    is_open = np.ones(len(centre), bool) if metal is None else distance_to_mesh(centre, metal) > tolerance
    rounded = np.round(deposit.face_normals, 2)
    kinds, number = np.unique(rounded[is_open], axis=0, return_inverse=True)
    area = np.bincount(number.ravel(), weights=2 * deposit.face_areas[is_open], minlength=len(kinds))
    planes = [kinds[k] for k in np.argsort(-area, kind="stable")[:3] if np.linalg.norm(kinds[k]) > 0.5]
    axes = sorted((sign * row for row in np.eye(3) for sign in (1.0, -1.0)), key=lambda axis: -float(axis @ main))
    found: list[Floats] = []
    for one in [main, *planes, *axes]:
        unit = make_unit(one)
        if all(unit @ other < ALIKE for other in found):
            found.append(unit)
    return found[:MOST_DIRECTIONS]


def choose_direction(
    body: Any, origin: Floats, directions: Sequence[Floats], around: Surroundings, process: Process, planner: Planner
) -> Plan:
    """The plan of the direction that fills most of a body: the first that fills all of it; else the best by trials with
    larger beads. At least one direction is needed.

    Layers along a floor take long: the first direction is kept where it leaves `LITTLE`, others are tried in planes.
    """
    volume, frames = float(body.volume()), [make_frame(one, origin) for one in directions]

    @cache
    def try_all(trial: Planner) -> Floats:
        return _try_directions(body, origin, directions, around, process, trial)

    @cache
    def plan_again(number: int) -> Plan:
        return planner(body, frames[number], around, process)

    def find_better(least: float, trial: Planner, share: float) -> Plan | None:
        """The plan of another direction, if it leaves less than ``least``, and trials up to that share of it."""
        lost = try_all(trial)
        best = int(np.argmin(lost))
        if best == 0 or lost[best] * volume > share * least:
            return None
        other = plan_again(best)
        return other if other.missing_volume < least else None

    def find_other(least: float) -> Plan | None:
        if len(directions) == 1 or least - min(least, NO_REASON[BESIDE] * volume) <= LITTLE * volume:
            return None
        return find_better(least, plan_planar, CLEARLY)

    if planner is plan_conformal:
        # where another direction leaves less than the first one's layers do not even cover, that is not filled
        first = plan_conformal(body, frames[0], around, process, find_other=find_other)
    else:
        first = planner(body, frames[0], around, process)
    # where the first direction has no such layers, it is to be seen whether another has some
    in_planes = planner is plan_conformal and (bool(first.passes) or LOST in first.reasons)
    if len(directions) == 1 or _measure_worth(first, volume) <= (LITTLE if in_planes else ENOUGH) * volume:
        return first
    # planes may lose far less than layers along the floor with the same direction, so the two are not compared closely
    trial, share = (plan_planar, CLEARLY) if in_planes else (planner, np.inf)
    return find_better(first.missing_volume, trial, share) or first


def _try_directions(
    body: Any, origin: Floats, directions: Sequence[Floats], around: Surroundings, process: Process, planner: Planner
) -> Floats:
    """The share of a body that is lost with each of the directions (N,), by trials with larger beads; too little
    where a trial was given up because that is more than another loses."""
    coarse, rough, volume = process.coarsen(COARSE), body.simplify(ROUGH * process.height), float(body.volume())
    lost: list[float] = []
    for one in directions:
        # one that is worse than the best so far shows it before its last layer
        trial = replace(coarse, give_up=min(lost, default=np.inf) + CLEARLY_WORSE * volume)
        # by reason: to unite what is missing takes long, and its pieces hardly overlap
        lost.append(sum(planner(rough, make_frame(one, origin), around, trial).reasons.values()))
    return np.asarray(np.round(np.array(lost) / volume, 3))


def _measure_worth(plan: Plan, volume: float) -> float:
    """What is missing of a body and may not be with another direction."""
    usual = sum(min(plan.reasons.get(why, 0.0), share * volume) for why, share in NO_REASON.items())
    return plan.missing_volume - usual


def plan_parts(
    body: Any, origin: Floats, directions: Sequence[Floats], around: Surroundings, process: Process, planner: Planner
) -> list[Plan]:
    """Plans for the whole body, each for what the ones before have left, with a direction of its own.

    With 3 axes there is one plan. With more, the directions of later plans lie within the machine's tilt of the first.
    Layers along a floor get another plan where the first leaves more than `LITTLE`, and trials in planes reach some of
    the rest. A body of several pieces, of which one direction leaves some, gets a plan for each piece if that leaves
    less: a direction that reaches a little of all leaves of each what no other reaches.
    """
    plans = [choose_direction(body, origin, directions, around, process, planner)]
    if process.axes == 3:
        return plans
    volume = float(body.volume())
    least = max((LITTLE if planner is plan_conformal else ENOUGH) * volume, process.bead.width**2 * process.height)
    if _measure_worth(plans[-1], volume) > least:
        pieces = _plan_pieces(body, origin, directions, around, process, planner)
        plans = pieces if pieces and pieces[-1].missing_volume < MOST_LEFT * plans[-1].missing_volume else plans
    within = _list_within(plans[0], directions, process)
    while len(plans) < MOST_PARTS:
        if _measure_worth(plans[-1], volume) <= least:
            break
        left_local = gather_missing(plans)
        there = _add_built(around, body - left_local, plans, process)
        if planner is plan_conformal:
            if not plans[-1].passes:
                break
            lost = _try_directions(left_local, origin, within, there, process, plan_planar)
            if lost.min() > MOST_LEFT:
                break
            plan = plan_conformal(left_local, make_frame(within[int(np.argmin(lost))], origin), there, process, 1.0)
        else:
            plan = choose_direction(left_local, origin, within, there, process, planner)
        if plan.missing_volume > MOST_LEFT * plans[-1].missing_volume:
            break
        plans.append(plan)
    return plans


def _plan_pieces(
    body: Any, origin: Floats, directions: Sequence[Floats], around: Surroundings, process: Process, planner: Planner
) -> list[Plan]:
    """A plan for each of the largest pieces of a body, the largest first, the last with what all of them leave; none
    where it has one piece. Smaller ones belong to the first."""
    from manifold3d import Manifold, OpType

    least = LITTLE * float(body.volume())
    pieces = sorted(body.decompose(), key=lambda piece: -float(piece.volume()))
    large = [piece for piece in pieces[:MOST_PARTS] if piece.volume() > least]
    if len(large) < 2:
        return []
    large[0] = Manifold.batch_boolean([large[0], *pieces[len(large) :]], OpType.Add)
    plans: list[Plan] = []
    built = Manifold()
    for piece in large:
        tried = _list_within(plans[0], directions, process) if plans else directions
        plan = choose_direction(piece, origin, tried, _add_built(around, built, plans, process), process, planner)
        missing, before = gather_missing([plan]), gather_missing(plans[-1:])
        built += piece if missing is None else piece - missing
        if before is not None:
            own = plan.frame.move(before)
            reasons = Counter(plan.reasons) + Counter(plans[-1].reasons)
            plan = replace(plan, missing=own if plan.missing is None else plan.missing + own, reasons=dict(reasons))
        plans.append(plan)
    return plans


def _list_within(first: Plan, directions: Sequence[Floats], process: Process) -> list[Floats]:
    """The directions that the machine reaches where it holds the part for the first plan."""
    return [one for one in directions if one @ first.frame.direction >= np.cos(process.tilt) - 1e-9]


def _add_built(around: Surroundings, built: Any, plans: Sequence[Plan], process: Process) -> Surroundings:
    """The surroundings with what is built, a Manifold, and the beads of plans."""
    beads = [Mesh(mesh.vertices @ plan.frame.turn, mesh.faces) for plan in plans for mesh in _draw_plan(plan, process)]
    return replace(around, metal=around.metal + built, others=[*around.others, *beads])


def _draw_plan(plan: Plan, process: Process) -> list[Mesh]:
    """The beads of a plan, in its local coordinates."""
    return [draw_passes(plan.passes, process.bead.width, plan.height)] if plan.passes else []


def gather_missing(plans: Sequence[Plan]) -> Any:
    """What the last of the plans leaves, as a Manifold relative to the frame's origin; None where it leaves nothing."""
    last = plans[-1] if plans else None
    if last is None or last.missing is None:
        return None
    return last.missing.transform(np.hstack([last.frame.turn.T, np.zeros((3, 1))]))
