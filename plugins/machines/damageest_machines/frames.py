"""Frames, rotations and angles."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats
from damageest_machines.definition import Frame, Pointing

OPPOSITE = -0.9998
"""Cosine from which on two directions count as opposite: then there is no shortest turn from one to the other."""


def make_transform(frame: Frame) -> Floats:
    """The transform (4,4) that takes a point of the frame to the one that it lies in."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", frame.rotation, degrees=True).as_matrix()
    T[:3, 3] = frame.position
    return T


def read_angles(turns: Floats) -> Floats:
    """Angles (N,3) about x, y, z, in degrees, of rotations (N,3,3) = Rz Ry Rx; about z without jumps of a whole
    turn."""
    cosine = np.hypot(turns[:, 0, 0], turns[:, 1, 0])
    y = np.arctan2(-turns[:, 2, 0], cosine)
    # where x is along z, only the sum of the two other angles is known: all of it is given to z
    is_free = cosine < 1e-9
    x = np.where(is_free, 0.0, np.arctan2(turns[:, 2, 1], turns[:, 2, 2]))
    z = np.where(is_free, np.arctan2(-turns[:, 0, 1], turns[:, 1, 1]), np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    return np.asarray(np.degrees(np.stack([x, y, z], axis=1)))


def read_quaternions(turns: Floats) -> Floats:
    """Quaternions (N,4), the scalar first, of rotations (N,3,3); each on the side of the one before."""
    found = np.roll(Rotation.from_matrix(turns).as_quat(), 1, axis=1)
    found *= np.where(found[0, 0] < 0, -1.0, 1.0) if len(found) else 1.0
    sides = np.where((found[1:] * found[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.asarray(found * np.concatenate([np.ones(min(len(found), 1)), np.cumprod(sides)])[:, None])


def turn_between(start: Floats, ends: Floats) -> Floats:
    """The shortest rotations (N,3,3) that take the unit vector ``start`` (3,) to ``ends`` (N,3), none opposite to
    it."""
    cross = np.cross(start, ends)
    cosine = ends @ start
    K = np.zeros((len(ends), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -cross[:, 2], cross[:, 1], -cross[:, 0]
    K -= np.swapaxes(K, 1, 2)
    return np.asarray(np.eye(3) + K + K @ K / (1 + cosine)[:, None, None])


def make_tool_frame(axis: Floats, points: Pointing, spin: float) -> Floats:
    """The frame (3,3) of a tool whose axis away from the work is ``axis`` (3,): its x, or y, lies along x of the base
    as far as it can, turned by ``spin`` degrees."""
    side = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    side = side - (side @ axis) * axis
    side = Rotation.from_rotvec(np.radians(spin) * axis).apply(side / np.linalg.norm(side))
    if points == "x":  # x to the work, z to the side
        return np.stack([-axis, np.cross(side, -axis), side], axis=1)
    z = -axis if points == "z" else axis
    return np.stack([side, np.cross(z, side), z], axis=1)


def point_along(points: Pointing) -> Floats:
    """The direction (3,) from the flange to the work in the tool's frame."""
    return {"x": np.array([1.0, 0, 0]), "z": np.array([0, 0, 1.0]), "-z": np.array([0, 0, -1.0])}[points]
