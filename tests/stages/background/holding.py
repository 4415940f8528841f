"""What every background must do, for the tests of each."""

from __future__ import annotations

import igl
import numpy as np
import trimesh

from damageest.artefacts import Mesh, Part, Solid, Surface
from tests.stages._open import bowl


def box(size: tuple[float, float, float] = (40, 30, 20), away: tuple[float, float, float] = (0, 0, 0)) -> Part:
    mesh = trimesh.creation.box(size)
    return Part(mesh.vertices + np.array(away), mesh.faces)


def dent(top: float = 10.0, away: tuple[float, float, float] = (0, 0, 0)) -> Surface:
    surface = bowl(6, top, 0.5)
    return Surface(surface.vertices + np.array(away), surface.faces)


def measure_longest_edge(mesh: Mesh) -> float:
    corners = mesh.triangles
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def measure_gap(background: Solid, part: Part, surface: Surface) -> tuple[float, bool]:
    """(nearest distance of the part's and the damage surface's points to the background, whether all are inside)."""
    points = np.concatenate([part.vertices, part.triangles.mean(axis=1), surface.vertices])
    origin = part.bounds.mean(axis=0)
    vertices, faces = np.ascontiguousarray(background.vertices - origin), np.array(background.faces)
    squared = igl.point_mesh_squared_distance(np.ascontiguousarray(points - origin), vertices, faces)[0]
    inside = igl.fast_winding_number(vertices, faces, np.ascontiguousarray(points - origin)) > 0.5
    return float(np.sqrt(squared.min())), bool(inside.all())
