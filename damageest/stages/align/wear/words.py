"""Motions of the scan as shifts and turns of the part's frame, and as text."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, FreeMotion, Vector
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.wear.skin_patches import Patches

ARM = 0.3
"""Distance from the axis of a turn, in diagonals, of skin that it moves."""
MOSTLY = 0.15
"""Movement by the turn, as a share of that by the shift, below which a motion is called a shift."""
NEGLIGIBLE = 0.05
"""Component of a motion, as a share of its largest one, that is taken as 0."""
MIN_HELD = 0.01
"""Information about a motion that the datum has to give, as a share of what all of the skin seen gives."""


def to_free_motion(frame: Frame, twist: Floats, low: float, high: float, unit: str) -> FreeMotion:
    """A motion by a twist (6,), a rotation vector and a translation for each diagonal, in the job's unit and the part's
    frame. ``low``, ``high``: its range in diagonals."""
    turn, shift = twist[:3], twist[3:]
    angle = float(np.linalg.norm(turn))
    if angle * ARM < MOSTLY * float(np.linalg.norm(shift)):
        scale = float(np.linalg.norm(shift)) * frame.size
        direction, low, high = _orient(shift, low * scale, high * scale)
        return FreeMotion(direction, low, high, text=_describe_shift(direction, low, high, unit))
    direction, low, high = _orient(turn, low * frame.size, high * frame.size)
    x, y, z = frame.centre + frame.size * np.cross(turn, shift) / angle**2
    point = (float(x), float(y), float(z))
    corners = frame.target.mesh.vertices * frame.size + frame.centre
    arm = float(np.linalg.norm(np.cross(np.array(direction), corners - np.array(point)), axis=1).max())
    # the skin that moves most is the farthest from the axis
    scale = angle * arm / frame.size
    low, high = low * scale, high * scale
    return FreeMotion(direction, low, high, point, 1 / arm, _describe_turn(direction, point, low, high, unit))


def describe_open(frame: Frame, patches: Patches, datum: Flags, unit: str) -> tuple[str, ...]:
    """A note for each motion that the datum does not fix, and that the rest of the skin has fixed therefore."""
    slopes = patches.slopes
    values, vectors = np.linalg.eigh((slopes[datum] * patches.weight[datum, None]).T @ slopes[datum])
    left = vectors.T[values < MIN_HELD * patches.weight.sum()]
    if not len(left):
        return ()
    named = "; ".join(
        name_motion(to_free_motion(frame, one, 0.0, 0.0, unit)) for one in simplify(left @ patches.basis.T)
    )
    return (f"the datum does not fix {named}, but other skin does; name more skin in align.datum to fix it",)


def simplify(twists: Floats) -> Floats:
    """Twists (M,6) that span the same motions as the given ones, with shifts apart from turns, and each along an axis
    where that is possible (reduced row echelon form)."""
    rows = twists / np.abs(twists).max(axis=1, keepdims=True)
    done = 0
    for column in range(6):
        pivot = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[pivot, column]) < NEGLIGIBLE:
            rows[done:, column] = 0.0
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= rows[others, column][:, None] * rows[done]
        done += 1
        if done == len(rows):
            break
    return np.asarray(rows)


def _orient(vector: Floats, low: float, high: float) -> tuple[Vector, float, float]:
    """The unit vector, turned so that its largest component is positive, with the range along it."""
    unit = vector / np.linalg.norm(vector)
    unit = np.where(np.abs(unit) < 1e-3, 0.0, unit)
    unit = unit / np.linalg.norm(unit)
    if unit[int(np.argmax(np.abs(unit)))] < 0:
        unit, low, high = -unit, -high, -low
    x, y, z = (float(value) + 0.0 for value in unit)
    return (x, y, z), float(low) + 0.0, float(high) + 0.0


def name_motion(motion: FreeMotion) -> str:
    x, y, z = motion.direction
    if motion.point is None:
        return f"a shift along ({x:.2f}, {y:.2f}, {z:.2f})"
    a, b, c = motion.point
    return f"a turn about ({x:.2f}, {y:.2f}, {z:.2f}) through ({a:.3g}, {b:.3g}, {c:.3g})"


_REMEDY = (
    "and either of two opposite faces may be worn; name unworn faces in align.datum, or give a known pose by "
    "align: none"
)


def _describe_shift(direction: Vector, low: float, high: float, unit: str) -> str:
    return (
        f"the pose is free for {name_motion(FreeMotion(direction, low, high))}, from {low:.3g} to {high:+.3g} {unit}: "
        f"no unworn skin fixes it, {_REMEDY}"
    )


def _describe_turn(direction: Vector, point: Vector, low: float, high: float, unit: str) -> str:
    named = name_motion(FreeMotion(direction, low, high, point))
    return (
        f"the pose is free for {named}, which moves the skin from {low:.3g} to {high:+.3g} {unit}: no unworn skin "
        f"fixes it, {_REMEDY}"
    )
