"""The plane motion that takes an outline onto the scan, wear left aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.sections.outlines import FlatScan, Loop, measure_offsets

ROUNDS = 25
"""Rounds of the robust fit."""
SCALE = 2.5
"""Distance, in standard deviations, from which a point counts less (Geman and McClure's weights)."""
WIDE, NARROWS = 3.0, 0.75
"""That distance in the first round, in units of the slack, and by how much it shrinks with each round."""
MOST_POINTS = 6000
"""Points of a fit; more do not change it."""
WEAKEST = 1e-3
"""Smallest eigenvalue of the equations, in the largest, with which a motion is fixed."""


@dataclass(frozen=True, eq=False)
class PlaneMotion:
    """A turn about ``centre`` (2,) by ``angle``, in radians, then a ``shift`` (2,). ``covariance`` (3,3): of shift and
    angle, by the noise. ``left``: standard deviation of what the motion leaves."""

    centre: Floats
    shift: Floats
    angle: float
    covariance: Floats
    left: float

    def move(self, places: Floats) -> Floats:
        """Places (N,2) of the part as designed, moved."""
        return np.asarray((places - self.centre) @ _turn(self.angle).T + self.centre + self.shift)

    def undo(self, places: Floats) -> Floats:
        """Places (N,2), moved back."""
        return np.asarray((places - self.centre - self.shift) @ _turn(self.angle) + self.centre)


def fit_motion(scan: FlatScan, loops: list[Loop], noise: float, along: Floats, slack: float) -> PlaneMotion | None:
    """The motion that takes the outlines onto the points; None where they do not fix it, as on a circle.

    Each stretch of the outline counts alike, however densely it was scanned. Points that a motion leaves far from the
    outline count little, so that wear does not pull. Beside the motion the outline may be larger by an offset, longer
    ``along`` (2,) a direction, and thicker across it: a thicker or shorter section is not taken for a moved one. Where
    the points do not part these from the motion, as on one side of a wall, a standard deviation ``slack`` of each is in
    the covariance.
    """
    if len(scan.points) < 30:
        return None
    step = -(-len(scan.points) // MOST_POINTS)
    points, weights = scan.points[::step], _weigh(scan, loops)[::step]
    centre = np.average(points, axis=0, weights=weights)
    size = float(np.sqrt(np.average(((points - centre) ** 2).sum(axis=1), weights=weights)))
    across = np.array([-along[1], along[0]])
    shift, angle, grown = np.zeros(2), 0.0, np.zeros(3)
    normal, left = np.eye(6), max(noise, 1e-9)
    for turn in range(ROUNDS):
        motion = PlaneMotion(centre, shift, angle, np.eye(3), 0.0)
        back = motion.undo(points)
        _, _, distance, foot, facing = measure_offsets(back, loops)
        arm = foot - centre
        longer = (arm @ along) / size * (facing @ along)
        height = arm @ across
        thicker = height / np.sqrt(np.average(height**2, weights=weights)) * (facing @ across)
        more = np.column_stack([np.ones(len(points)), longer, thicker])
        distance = distance - more @ grown
        middle = float(np.median(np.abs(distance)))
        # from wide to narrow: edges that a shorter section leaves off count until its length is known
        scale = max(SCALE * 1.4826 * middle, SCALE * noise, WIDE * slack * NARROWS**turn, 1e-9)
        trust = weights / (1 + (distance / scale) ** 2) ** 2
        rows = np.column_stack([facing, (arm[:, 0] * facing[:, 1] - arm[:, 1] * facing[:, 0]) / size, more])
        normal = (rows * trust[:, None]).T @ rows
        rigid = np.linalg.eigvalsh(normal[:3, :3])
        if rigid[0] < WEAKEST * rigid[-1]:
            return None
        prior = np.array([0, 0, 0, 1, 1, 1]) * (left / slack) ** 2
        normal = normal + np.diag(prior)
        asked = (rows * trust[:, None]).T @ distance - prior * np.array([0, 0, 0, *grown])
        change = np.linalg.solve(normal, asked)
        shift = shift + _turn(angle) @ change[:2]
        angle += float(change[2]) / size
        grown = grown + change[3:]
        left = float(np.sqrt(np.average(distance**2, weights=np.maximum(trust, 1e-12))))
        if turn > 15 and np.abs(change).max() < 1e-4 * max(noise, 1e-6 * size):
            break
    to_angle = np.diag([1.0, 1.0, 1 / size])
    spread = (rows * trust[:, None] ** 2).T @ rows * left**2 + np.diag(prior) * left**2
    covariance = (np.linalg.inv(normal) @ spread @ np.linalg.inv(normal))[:3, :3]
    return PlaneMotion(centre, shift, angle, to_angle @ covariance @ to_angle, left)


def _weigh(scan: FlatScan, loops: list[Loop]) -> Floats:
    """Weights (N,) with which each piece of the outlines counts alike."""
    total = sum(loop.length for loop in loops)
    code = scan.loop * 1000 + np.floor(scan.at / total * 200).astype(np.int64)
    count = np.unique(code, return_inverse=True, return_counts=True)
    weight = 1 / np.maximum(count[2][count[1]], 3.0)
    return np.asarray(weight / weight.mean())


def _turn(angle: float) -> Floats:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
