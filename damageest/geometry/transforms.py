"""Rigid transforms (4,4) applied to meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from damageest.artefacts import Floats, Mesh, Pose

M = TypeVar("M", bound=Mesh)


def invert_pose(pose: Pose) -> Floats:
    """T_scan_part (4,4): takes a point from the part's frame to the scanner's."""
    R, t = pose.T_part_scan[:3, :3], pose.T_part_scan[:3, 3]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R.T, -R.T @ t
    return T


def move_mesh(mesh: M, T: Floats | None) -> M:
    """The mesh with its vertices moved by a rigid T (4,4); itself where T is None."""
    return mesh if T is None else replace(mesh, vertices=mesh.vertices @ T[:3, :3].T + T[:3, 3])
