"""Meshes for others: in the scan's frame, with fewer facets, and as trimesh and manifold3d objects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import Floats, Mesh, Pose, Solid
from damageest.solids import to_manifold, to_solid

M = TypeVar("M", bound=Mesh)

_SAME_VOLUME = 1e-3
_SLIVERS = 2e-3
"""Share of the surface that may lie farther off: wafers and spikes without volume, as Booleans leave them, go."""


def scan_from_part(pose: Pose) -> Floats:
    """T_scan_part (4,4): takes a point from the part's frame to the scanner's."""
    R, t = pose.T_part_scan[:3, :3], pose.T_part_scan[:3, 3]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R.T, -R.T @ t
    return T


def moved(mesh: M, T: Floats | None) -> M:
    """The mesh with its vertices moved by a rigid T (4,4); itself where T is None."""
    return mesh if T is None else replace(mesh, vertices=mesh.vertices @ T[:3, :3].T + T[:3, 3])


def as_trimesh(mesh: Mesh, T: Floats | None = None) -> Any:
    """A ``trimesh.Trimesh`` of its own, moved by T, nothing merged or reordered."""
    from trimesh import Trimesh

    return Trimesh(np.array(moved(mesh, T).vertices), np.array(mesh.faces), process=False)


def as_manifold(solid: Solid, T: Floats | None = None) -> Any:
    """A ``manifold3d.Manifold``, moved by T."""
    return to_manifold(moved(solid, T))


def shells(solid: Solid) -> list[tuple[Solid, list[Solid]]]:
    """Each connected body as its outer skin, and its cavities as solids of their own."""
    size, faces = len(solid.vertices), solid.faces
    links = coo_array((np.ones(2 * len(faces)), np.concatenate([faces[:, :2], faces[:, 1:]]).T), shape=(size, size))
    label = connected_components(links, directed=False)[1][faces[:, 0]]
    outer: list[Solid] = []
    cavities: list[Solid] = []
    for number in np.unique(label):
        used, own = np.unique(faces[label == number], return_inverse=True)
        own = own.reshape(-1, 3)
        for found, turned in ((outer, own), (cavities, own[:, ::-1])):
            try:
                found.append(Solid(solid.vertices[used], turned))
                break
            except ValueError:  # inside out, or flat: neither
                continue
    out: list[tuple[Solid, list[Solid]]] = [(body, []) for body in outer]
    for cavity in cavities:
        holding = [pair for pair in out if len(out) == 1 or _holds(pair[0], cavity)]
        if holding:
            min(holding, key=lambda pair: pair[0].volume)[1].append(cavity)
    return out


def _holds(body: Solid, cavity: Solid) -> bool:
    import igl

    return bool(igl.winding_number(body.vertices, np.array(body.faces), cavity.vertices[:1])[0] > 0.5)


def simplified(solid: Solid, detail: float) -> Solid:
    """The solid with fewer triangles, its surface within ``detail`` of what it was and its volume within 0.1 %.

    Both are measured, body by body: one that cannot be simplified so far stays as it is.
    """
    vertices: list[Floats] = []
    faces = []
    count = 0
    for outer, cavities in shells(solid):
        for shell, step in ((outer, 1), *((cavity, -1) for cavity in cavities)):
            less = _fewer(shell, detail)
            vertices.append(less.vertices)
            faces.append(less.faces[:, ::step] + count)
            count += len(less.vertices)
    return Solid(np.concatenate(vertices), np.concatenate(faces)) if vertices else solid


def _fewer(body: Solid, detail: float) -> Solid:
    area = np.linalg.norm(body.cross, axis=1)
    origin = body.bounds.mean(0)
    for share in (0.5, 0.2, 0.05):
        try:
            less = to_solid(to_manifold(body, origin).simplify(share * detail), origin)
        except ValueError:
            return body
        if less is None or len(less.faces) >= len(body.faces):
            continue
        lost = area[(_off(body, less) > detail)[body.faces].any(axis=1)].sum() / area.sum()
        same = abs(less.volume / body.volume - 1) <= _SAME_VOLUME
        if same and lost <= _SLIVERS and _off(less, body).max() <= detail:
            return less
    return body


def _off(one: Mesh, two: Mesh) -> Floats:
    """(V,) distances of the vertices of one to the surface of two."""
    import igl

    return np.asarray(np.sqrt(igl.point_mesh_squared_distance(one.vertices, two.vertices, np.array(two.faces))[0]))
