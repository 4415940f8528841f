"""How a damage volume depends on motions that unworn skin does not exclude, and on other poses that fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, FreeMotion, Part, Pose, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.transforms import move_points

SAMPLES = 500
"""Places on the removed skin that are looked for in another pose."""


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

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest change of the volume within the motion."""
        low, high = sorted((self.rate * self.motion.low, self.rate * self.motion.high))
        return low, high


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


def measure_hidden_wear(part: Part, pose: Pose) -> float:
    """The most metal that may be worn without a site: what the skin sweeps, to one side, in the largest free motion.

    Wear of a whole face moves the pose, and the scan then lies on the part as if nothing were lost.
    """
    centres, outward = part.triangles.mean(axis=1), part.cross / 2
    swept = [np.einsum("ij,ij->i", motion.move(centres), outward) for motion in pose.free]
    reach = [max(motion.high, -motion.low) for motion in pose.free]
    return max((float(np.abs(one).sum()) / 2 * far for one, far in zip(swept, reach, strict=True)), default=0.0)


def describe_motion(motion: FreeMotion, unit: str) -> str:
    """The motion in a few words."""
    x, y, z = motion.direction
    kind = "a shift along" if motion.point is None else "a turn about"
    return f"{kind} ({x:.2f}, {y:.2f}, {z:.2f}) from {motion.low:.3g} to {motion.high:+.3g} {unit}"


def compare_other_poses(damage: Solid, part: Part, pose: Pose, tolerance: float) -> float:
    """Share of the skin that a damage volume removes which is not skin of the part in another pose that fits as well.

    In a pose that a symmetry of the part makes, the same metal is lost. Where the share is large, the poses differ in
    which metal it is.
    """
    if pose.alternatives is None or not len(pose.alternatives):
        return 0.0
    on_skin = np.flatnonzero(~find_inner_faces(damage, part) & (damage.face_areas > 0))
    if not len(on_skin):
        return 0.0
    places = sample_by_area(damage, SAMPLES, np.random.default_rng(0), on_skin)[0]
    back = np.linalg.inv(pose.T_part_scan)
    away = [distance_to_mesh(move_points(places, other @ back), part) > tolerance for other in pose.alternatives]
    return float(max(one.mean() for one in away))
