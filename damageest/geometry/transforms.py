"""Rigid transforms (4,4): the inverse of a pose, and moved meshes."""

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


def move_mesh(mesh: M, T: Floats | None) -> M:
    """The mesh, of the same class, with its vertices mapped by a rigid ``T`` (4,4); the same mesh where T is None.

    Translation and vertices are in one unit. Other fields stay as they are.
    """
    return mesh if T is None else replace(mesh, vertices=mesh.vertices @ T[:3, :3].T + T[:3, 3])
