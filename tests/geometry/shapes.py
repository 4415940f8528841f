"""Meshes of known size, for the tests of the toolbox."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.solids import concatenate_meshes

FAR = np.array([1e5, -2e5, 3e5])
"""A place far from the origin."""


def as_solid(mesh: trimesh.Trimesh, at: Sequence[float] | Floats = (0, 0, 0)) -> Solid:
    return Solid(mesh.vertices + np.asarray(at), mesh.faces)


def box(size: float | Sequence[float] = 10.0, at: Sequence[float] | Floats = (0, 0, 0)) -> Solid:
    """A box or cube about ``at``."""
    return as_solid(trimesh.creation.box(np.broadcast_to(size, 3)), at)


def ball(radius: float = 5.0, at: Sequence[float] | Floats = (0, 0, 0), subdivisions: int = 3) -> Solid:
    return as_solid(trimesh.creation.icosphere(subdivisions, radius), at)


def torus(major: float = 15.0, minor: float = 4.0) -> Solid:
    return as_solid(trimesh.creation.torus(major, minor, major_sections=64, minor_sections=32))


def join(*meshes: Mesh) -> tuple[Floats, np.ndarray]:
    """Vertices and faces of several meshes as one."""
    return concatenate_meshes(meshes)[:2]


def invert(mesh: Mesh) -> Mesh:
    """The mesh with its faces turned to the other side."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def measure_volume(vertices: Floats, faces: np.ndarray) -> float:
    """By trimesh, independently of `Solid`."""
    return float(trimesh.Trimesh(vertices - vertices.mean(axis=0), faces, process=False).volume)


def draw_pose(rng: np.random.Generator, reach: float = 100.0) -> Floats:
    """A random rigid transform (4,4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-reach, reach, 3)
    return T
