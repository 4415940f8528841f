"""How a damage volume depends on motions that unworn skin does not exclude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, FreeMotion, Part, Pose, Solid
from damageest.geometry.skin import find_inner_faces

OPEN = 0.02
"""Change of a damage volume, as a share of it, from which it is not proven."""
DOUBTFUL = 0.1
"""Change from which the damage volume is doubtful."""


@dataclass(frozen=True)
class Dependence:
    """How a damage volume changes with a free ``motion``.

    ``rate``: change of its volume for each unit of the motion. ``moved``: volume between its inner surface and the same
    after the motion, for each unit; it is larger than the rate where the volume grows on one side and shrinks on the
    other.
    """

    motion: FreeMotion
    rate: float
    moved: float

    @property
    def reach(self) -> float:
        """The largest movement that the scan does not exclude, in the job's unit."""
        return max(self.motion.high, -self.motion.low)


def measure_dependence(damage: Solid, part: Part, pose: Pose) -> tuple[Dependence, ...]:
    """How a damage volume depends on each of the free motions of a pose: its inner surface moves with the scan."""
    if not pose.free:
        return ()
    inner = find_inner_faces(damage, part)
    centres: Floats = damage.triangles[inner].mean(axis=1)
    outward = damage.cross[inner] / 2
    found = []
    for motion in pose.free:
        swept = np.einsum("ij,ij->i", motion.move(centres), outward)
        found.append(Dependence(motion, float(swept.sum()), float(np.abs(swept).sum())))
    return tuple(found)


def ask_free_pose(
    dependences: tuple[Dependence, ...], volume: float, unit: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The reasons against a site of some ``volume``, and the questions that stay open, that a free pose gives."""
    against: list[str] = []
    questions: list[str] = []
    for one in dependences:
        share = one.moved * one.reach / volume
        if share > OPEN:
            (against if share > DOUBTFUL else questions).append(_describe(one, volume, unit))
    return tuple(against), tuple(questions)


def _describe(one: Dependence, volume: float, unit: str) -> str:
    motion = one.motion
    x, y, z = motion.direction
    kind = "a shift along" if motion.point is None else "a turn about"
    ends = sorted(max(volume + one.rate * amount, 0.0) for amount in (motion.low, motion.high))
    return (
        f"its volume depends on the pose, which is free for {kind} ({x:.3f}, {y:.3f}, {z:.3f}) from {motion.low:.3g} "
        f"to {motion.high:+.3g} {unit}: {ends[0]:.4g} to {ends[1]:.4g} {unit}³, and the worn metal may lie on the "
        "opposite side; name faces that are not worn in align.datum"
    )
