"""Rotations of the part about an axis that map it (nearly) onto itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.geometry.transforms import make_motions

PARALLEL, NEAR = 0.995, 0.02


@dataclass(frozen=True)
class Axis:
    """A line in the part's frame: its unit ``direction`` (3,) and its ``point`` (3,) nearest to the origin."""

    direction: Floats
    point: Floats

    def make_turns(self, angles: Floats) -> Floats:
        """Rotations (K,4,4) about the axis by angles (K,) in radians."""
        result = make_motions(np.column_stack([angles[:, None] * self.direction, np.zeros((len(angles), 3))]))
        result[:, :3, 3] = self.point - np.einsum("kij,j->ki", result[:, :3, :3], self.point)
        return result

    def is_turn(self, motions: Floats) -> NDArray[np.bool_]:
        """(K,) whether each of the rigid motions (K,4,4) is, nearly, a rotation about this axis."""
        direction, angle, point, slide = _find_screw(motions)
        same = (np.abs(direction @ self.direction) > PARALLEL) & (
            _measure_gap(point, self.point, self.direction) < NEAR
        )
        still = (angle < 0.05) & (np.linalg.norm(motions[:, :3, 3], axis=1) < NEAR)
        return np.asarray((same & (np.abs(slide) < NEAR) & (angle > 0.05)) | still)


def find_common_axis(poses: Floats) -> Axis | None:
    """The axis of the rotations by which most of the poses (K,4,4) differ from the first; None for fewer than two."""
    if len(poses) < 3:
        return None
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
    # A larger angle gives a more exact axis.
    weight = np.sin(angle[members] / 2) ** 2
    scatter = np.linalg.eigh((direction[members] * weight[:, None]).T @ direction[members])[1][:, 2]
    middle = np.average(point[members], axis=0, weights=weight)
    return Axis(scatter, middle - (middle @ scatter) * scatter)


def group_turns(poses: Floats, axis: Axis, wanted: int) -> list[int]:
    """Indices of at most ``wanted`` poses: one of each set of poses that differ by rotations about ``axis``."""
    firsts: list[int] = []
    for index in range(len(poses)):
        if firsts and axis.is_turn(poses[index][None] @ np.linalg.inv(poses[firsts])).any():
            continue
        firsts.append(index)
        if len(firsts) == wanted:
            break
    return firsts


def _find_screw(motions: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The screws of motions (K,4,4): direction (K,3), angle (K,) in radians, the point (K,3) of the axis nearest to the
    origin, and the translation (K,) along the axis."""
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
    """(K,) distance between parallel lines of a ``direction`` (3,), through points (K,3) and ``other`` (3,)."""
    across = point - other
    return np.asarray(np.linalg.norm(across - (across @ direction)[:, None] * direction, axis=1))
