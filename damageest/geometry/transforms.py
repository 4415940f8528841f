"""Rigid transforms (4,4): the inverse of a pose, moved meshes, and what is not rigid about a displacement."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from damageest.artefacts import Floats, Mesh, Pose

M = TypeVar("M", bound=Mesh)


def invert_pose(pose: Pose) -> Floats:
    """T_scan_part (4,4), the inverse of the pose T_part_scan: it maps points from the part's frame to the scanner's.

    The inverse is exact for a rigid transform only: the rotation is transposed.
    """
    R, t = pose.T_part_scan[:3, :3], pose.T_part_scan[:3, 3]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R.T, -R.T @ t
    return T


def move_points(points: Floats, T: Floats) -> Floats:
    """The points (N,3) mapped by ``T`` (4,4), whose translation is in their unit."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def turn_to_axis(axis: Floats) -> Floats:
    """A rotation (3,3) that takes z to the unit vector ``axis`` (3,)."""
    z = np.array([0.0, 0.0, 1.0])
    c = float(axis @ z)
    if c < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, y, _ = (float(value) for value in np.cross(z, axis))
    cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + c))


def make_motions(twist: Floats) -> Floats:
    """Rigid motions (H,4,4) from rotation vectors, in radians about the origin, and translations (H,6)."""
    from scipy.spatial.transform import Rotation

    T = np.tile(np.eye(4), (len(twist), 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(twist[:, :3]).as_matrix()
    T[:, :3, 3] = twist[:, 3:]
    return T


def find_nearest_motion(before: Floats, after: Floats, weights: Floats | None = None) -> Floats:
    """The rigid motion (4,4) that takes places (N,3) nearest to others (N,3), by least squares with weights (N,), all
    alike where there are none (Kabsch 1976). N is 3 or more."""
    from scipy.spatial.transform import Rotation

    one, two = np.average(before, axis=0, weights=weights), np.average(after, axis=0, weights=weights)
    T = np.eye(4)
    T[:3, :3] = Rotation.align_vectors(after - two, before - one, weights)[0].as_matrix()
    T[:3, 3] = two - T[:3, :3] @ one
    return T


def move_mesh(mesh: M, T: Floats | None) -> M:
    """The mesh, of the same class, with its vertices mapped by a rigid ``T`` (4,4); the same mesh where T is None.

    Translation and vertices are in one unit. Other fields stay as they are.
    """
    return mesh if T is None else replace(mesh, vertices=move_points(mesh.vertices, T))


def remove_rigid(points: Floats, displacement: Floats, weights: Floats) -> Floats:
    """The displacement (N,3) of points (N,3) without the rigid motion that is nearest to it, by weighted least squares.

    To first order in the angle, which is small.
    """
    if not len(points):
        return np.empty((0, 3))
    at = points - points.mean(axis=0)
    size = max(float(np.abs(at).max()), 1e-300)
    zero, (x, y, z) = np.zeros(len(at)), at.T / size
    turns = np.stack([np.stack(row, axis=1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], axis=2)
    basis = np.concatenate([turns, np.broadcast_to(np.eye(3), (len(at), 3, 3))], axis=2)
    root = np.sqrt(weights)[:, None]
    found = np.linalg.lstsq((basis * root[..., None]).reshape(-1, 6), (displacement * root).ravel(), rcond=1e-9)[0]
    return np.asarray(displacement - basis @ found)
