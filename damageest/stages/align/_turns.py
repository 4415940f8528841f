"""Turns about an axis of the part that (nearly) leave it as it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.stages.align._search import make_motion

PARALLEL, NEAR = 0.995, 0.02


@dataclass(frozen=True)
class Axis:
    """A line in the part's frame: unit ``direction`` (3,), and ``point`` (3,), its point nearest to the origin."""

    direction: Floats
    point: Floats

    def make_turns(self, angles: Floats) -> Floats:
        """Rotations (K,4,4) about the axis by angles (K,) in radians."""
        result = make_motion(np.column_stack([angles[:, None] * self.direction, np.zeros((len(angles), 3))]))
        result[:, :3, 3] = self.point - np.einsum("kij,j->ki", result[:, :3, :3], self.point)
        return result

    def is_turn(self, motions: Floats) -> NDArray[np.bool_]:
        """Which of the rigid motions (K,4,4) are turns about this axis, nearly (K,)."""
        direction, angle, point, slide = _find_screw(motions)
        same = (np.abs(direction @ self.direction) > PARALLEL) & (
            _measure_gap(point, self.point, self.direction) < NEAR
        )
        still = (angle < 0.05) & (np.linalg.norm(motions[:, :3, 3], axis=1) < NEAR)
        return np.asarray((same & (np.abs(slide) < NEAR) & (angle > 0.05)) | still)


def find_common_axis(poses: Floats) -> Axis | None:
    """The axis about which most of the poses (K,4,4) differ from the first by a turn; None where fewer than two do."""
    motions = poses[1:] @ np.linalg.inv(poses[0])
    direction, angle, point, slide = _find_screw(motions)
    turn = (angle > 0.1) & (np.abs(slide) < NEAR)
    direction, angle, point = direction[turn], angle[turn], point[turn]
    if len(direction) < 2:
        return None
    alike = np.abs(direction @ direction.T) > PARALLEL
    alike &= np.linalg.norm(point[:, None] - point[None], axis=2) < NEAR
    members = alike[np.argmax(alike.sum(1))]
    if members.sum() < 2:
        return None
    # The larger the angle, the better it fixes the axis.
    weight = np.sin(angle[members] / 2) ** 2
    scatter = np.linalg.eigh((direction[members] * weight[:, None]).T @ direction[members])[1][:, 2]
    middle = np.average(point[members], axis=0, weights=weight)
    return Axis(scatter, middle - (middle @ scatter) * scatter)


def group_turns(poses: Floats, axis: Axis, wanted: int) -> list[int]:
    """Indices of at most ``wanted`` poses, one of each set that turns about ``axis`` carry into one another."""
    heads: list[int] = []
    for index in range(len(poses)):
        if heads and axis.is_turn(poses[index][None] @ np.linalg.inv(poses[heads])).any():
            continue
        heads.append(index)
        if len(heads) == wanted:
            break
    return heads


def _find_screw(motions: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Direction (K,3), angle (K,) in radians, the axis' point (K,3) nearest to the origin, slide (K,) along it."""
    from scipy.spatial.transform import Rotation

    vector = Rotation.from_matrix(motions[:, :3, :3]).as_rotvec()
    angle = np.linalg.norm(vector, axis=1)
    direction = vector / np.maximum(angle, 1e-12)[:, None]
    shift = motions[:, :3, 3]
    slide = np.einsum("ij,ij->i", shift, direction)
    flat = shift - slide[:, None] * direction
    point = flat / 2 + np.cross(direction, flat) / (2 * np.maximum(np.tan(angle / 2), 1e-6))[:, None]
    return direction, angle, point, slide


def _measure_gap(point: Floats, other: Floats, direction: Floats) -> Floats:
    across = point - other
    return np.asarray(np.linalg.norm(across - (across @ direction)[:, None] * direction, axis=1))
