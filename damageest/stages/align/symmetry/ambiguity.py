"""What is said where a scan fits the part in more than one pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, FreeMotion, Reason
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align.refine.robust_fit import fit, robust_cost
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.surface.oriented_points import orient_surface
from damageest.stages.align.surface.plane_grid import PartSurface
from damageest.stages.align.symmetry.choose import MANY, Choice, is_worse
from damageest.stages.align.symmetry.prepare_part import PreparedPart
from damageest.stages.align.symmetry.symmetries import SAME as SAME_SYMMETRY
from damageest.stages.align.symmetry.symmetries import measure_apart
from damageest.stages.align.wear.words import name_motion, to_free_motion

SAME = 0.002
"""Distance, in diagonals, up to which places of two surfaces are the same for a symmetry, where the scan is coarser."""

FEW = 4000
"""Points, spread over the scan, that are asked first whether a pose fits worse."""

LOOSE, BANDS = 0.01, 6.0
"""Mean square by which the skin moves along its normal for each unit of a motion that the points may not fix; and by
how many bands such a motion is tried."""
FARTHEST, HALVED = 0.25, 3
"""Farthest movement that is looked for, in diagonals, and halvings of the last step."""

REMEDY = "where the pose is known, give it to align: icp or align: none"


def find_loose_motions(frame: Frame, pose: Floats, points: Floats, band: float, unit: str) -> tuple[FreeMotion, ...]:
    """The motions by which the scan can be moved and fits as well, with how far; empty where it fixes the pose.

    A bar with both ends missing or unseen fits at any place along its axis. Each motion that hardly changes the points'
    distances to their planes is tried, in both directions from a few bands on, until the scan fits much worse.
    """
    target = frame.target
    at = move_points(points, pose)
    distance, _, face = target.closest(at)
    on = np.abs(distance) < band
    jacobian = np.column_stack([np.cross(at[on], target.normals[face[on]]), target.normals[face[on]]])
    stiffness, motions = np.linalg.eigh(jacobian.T @ jacobian / max(int(on.sum()), 1))
    surface = orient_surface(target.known, 5000, np.random.default_rng(0)).points
    here = robust_cost(distance, band)
    found = []

    def fits(motion: Floats) -> bool:
        return not _is_much_worse(target, points, make_motions(motion[None])[0] @ pose, band, here)

    for twist in motions.T[stiffness < LOOSE]:
        ends = [0.0, 0.0]
        for k, sign in enumerate((-1.0, 1.0)):
            start = sign * BANDS * band * twist
            moved = target.closest(move_points(surface, make_motions(start[None])[0]))[0]
            if (np.abs(moved) > band).mean() > 0.002 and fits(start):
                ends[k] = sign * _find_end(fits, sign * twist, BANDS * band)
        if any(ends):
            one = to_free_motion(frame, twist, ends[0], ends[1], unit)
            text = (
                f"the scan does not fix the pose for {name_motion(one)}, from {one.low:.3g} to {one.high:+.3g} {unit}: "
                "the surface that would fix it is missing, worn or unseen; "
                f"{REMEDY}"
            )
            found.append(replace(one, text=text))
    return tuple(found)


def _find_end(fits: Callable[[Floats], bool], way: Floats, start: float) -> float:
    """How far, in diagonals, the scan can be moved along a way (6,) and fits, from ``start`` on, where it does."""
    low, high = start, 2 * start
    while high < FARTHEST and fits(high * way):
        low, high = high, 2 * high
    if high >= FARTHEST:
        return min(low, FARTHEST)
    for _ in range(HALVED):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle * way) else (low, middle)
    return high


def _is_much_worse(target: PartSurface, points: Floats, pose: Floats, band: float, here: Floats) -> bool:
    """Whether the points (N,3) fit significantly worse in ``pose`` (4,4) than where they cost ``here`` (N,): mostly a
    few of them show it."""
    for step in sorted({max(1, len(points) // FEW), 1}, reverse=True):
        cost = robust_cost(target.closest(move_points(points[::step], pose))[0], band)
        if is_worse(cost, here[::step]):
            return True
    return False


def describe_choice(choice: Choice) -> tuple[str, ...]:
    """Notes for the user about the other poses; empty where there are none."""
    if choice.axis is not None:
        x, y, z = choice.axis.direction + 0.0
        return (
            f"the part fits at any angle about the axis ({x:.2f}, {y:.2f}, {z:.2f}) (symmetry): every turn is "
            "correct; use this one on the machine; the alternatives list quarter turns",
        )
    if len(choice.others):
        return (f"the part fits in {len(choice.others) + 1} poses equally well: use this one on the machine",)
    return ()


def note_ambiguity(choice: Choice, part: PreparedPart) -> tuple[Reason, ...]:
    """A doubt where other poses fit as well and are not symmetries of the part; empty where there are none."""
    target, motions, band = part.surface, choice.others @ np.linalg.inv(choice.pose), choice.band
    if len(choice.poses) >= MANY and choice.axis is None:
        known = [measure_apart(part.symmetries, one).min() < SAME_SYMMETRY for one in motions]
        motions = motions[~np.array(known)]
    if not len(motions):
        return ()
    surface = orient_surface(target.known, 5000, np.random.default_rng(0)).points
    if band > 2 * SAME:
        # poses of a coarse scan are less exact than the part: the motions are fitted, and a hole that is larger counts
        moved = [fit(target, move_points(surface, D), np.eye(4), band, SAME / 4, 12).pose @ D for D in motions]
        motions, band = np.array(moved), max(SAME, 0.25 * band)
    apart = max(float((np.abs(target.closest(move_points(surface, D))[0]) > band).mean()) for D in motions)
    if apart <= 0.002:
        return ()
    text = (
        f"other poses fit that are no symmetries ({apart:.1%} of the surface differs): the damage found depends "
        "on the pose, and the surface that would decide is missing, unseen or too alike"
    )
    return (Reason("other_poses", text, "contradicts", apart, remedy=REMEDY),)
