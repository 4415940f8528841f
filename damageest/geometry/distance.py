"""Distances from points to triangle meshes, and which points lie inside. Questions to libigl's tree
of boxes go through it and `pseudonormals.py`.

Points and mesh are in one unit and one frame; distances are in that unit. Far from the origin, differences of
coordinates lose digits. So the functions first move points and mesh to the centre of the mesh's bounds, except where a
docstring says otherwise, and callers give coordinates as they are.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.duplicates import find_duplicates, list_used
from damageest.geometry.long_faces import Tree, build_tree
from damageest.geometry.pseudonormals import keep_signed_mesh
from damageest.geometry.vectors import measure_longest_edges, normalise
from damageest.geometry.voxels import order_by_place
from damageest.isolation.memory import FEWER_POINTS, require_memory

BYTES_OF_POINT, BYTES_OF_TRIANGLE = 230, 480
"""Memory of `signed_distance` for each point and each triangle, measured."""

MOST_KEPT = 100_000
"""Triangles up to which the tree of a mesh is kept with the mesh: the result's checks ask one damage volume ten times.
Of larger meshes the last one keeps its tree, as a part that all checks ask: more would hold memory that the next stages
need."""

_faults: WeakKeyDictionary[Mesh, tuple[Flags, Flags]] = WeakKeyDictionary()
_centred: WeakKeyDictionary[Mesh, SurfaceTree] = WeakKeyDictionary()
_large: WeakKeyDictionary[Mesh, SurfaceTree] = WeakKeyDictionary()


class Closest(NamedTuple):
    """The nearest places on a mesh: ``distance`` (N,) to it, not signed; ``face`` (N,) the nearest triangle; ``place``
    (N,3) the nearest point on that triangle."""

    distance: Floats
    face: Ints
    place: Floats


def closest_on_mesh(points: Floats, mesh: Mesh) -> Closest:
    """The nearest place on a mesh for each of ``points`` (N,3). The mesh may be open.

    Raises ValueError where the mesh has no triangle.
    """
    if not len(points):
        return _find_none()
    _require_some(mesh.faces, "triangle")
    centre = mesh.bounds.mean(axis=0)
    distance, face, place = keep_tree(mesh).closest(points - centre)
    return Closest(distance, face, place + centre)


def keep_tree(mesh: Mesh) -> SurfaceTree:
    """The tree of a mesh moved to the middle of its bounds, from an earlier call or made now."""
    kept = _centred if len(mesh.faces) <= MOST_KEPT else _large
    if (tree := kept.get(mesh)) is None:
        tree = SurfaceTree(Mesh(mesh.vertices - mesh.bounds.mean(axis=0), mesh.faces))
        if kept is _large:
            _large.clear()
        kept[mesh] = tree
    return tree


def distance_to_mesh(points: Floats, mesh: Mesh) -> Floats:
    """Distance (N,), not signed, of ``points`` (N,3) to a mesh, which may be open.

    Raises ValueError where the mesh has no triangle.
    """
    return closest_on_mesh(points, mesh).distance


def distance_to_edges(points: Floats, vertices: Floats, edges: Ints) -> Floats:
    """Distance (N,) of ``points`` (N,3) to the nearest of the straight ``edges`` (E,2) between ``vertices`` (V,3).

    Coordinates are moved to the mean of the vertices. Raises ValueError where there is no edge.
    """
    import igl

    if not len(points):
        return np.empty(0)
    _require_some(edges, "edge")
    centre = vertices.mean(axis=0)
    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points - centre), np.ascontiguousarray(vertices - centre), np.array(edges)
    )
    return np.asarray(np.sqrt(squared))


class SurfaceTree:
    """A mesh prepared for many closest-point queries.

    It does not move points and mesh to the origin: give it a mesh near the origin.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh

    @cached_property
    def tree(self) -> Tree:
        """libigl's tree over short pieces of the triangles, and these."""
        return build_tree(self.mesh.vertices, self.mesh.faces)

    def closest(self, points: Floats) -> Closest:
        """The nearest place on the mesh for each of ``points`` (N,3), as `closest_on_mesh` gives it.

        Raises ValueError where the mesh has no triangle.
        """
        if not len(points):
            return _find_none()
        _require_some(self.mesh.faces, "triangle")
        order = order_by_place(points)
        tree, vertices, faces, origin = self.tree
        query = np.ascontiguousarray(points[order], np.float64)
        squared, face, place = tree.squared_distance(vertices, faces, query)
        found = np.sqrt(np.ravel(squared)), origin[np.ravel(face)], np.reshape(place, (-1, 3))
        return Closest(*(_undo_order(order, column) for column in found))


def _require_some(rows: Ints, what: str) -> None:
    """Raises ValueError where there are no rows. libigl ends the process by a segmentation fault there."""
    if not len(rows):
        raise ValueError(f"no distance: the target has no {what}; ask only where there is one")


def _find_none() -> Closest:
    """The nearest places of no points."""
    return Closest(np.empty(0), np.empty(0, np.int64), np.empty((0, 3)))


def _undo_order(order: Ints, values: NDArray[Any]) -> NDArray[Any]:
    """The values (N,...) of ordered points, for the points as they were."""
    result = np.empty_like(values)
    result[order] = values
    return result


def winding_number(points: Floats, mesh: Mesh) -> Floats:
    """Winding number (N,) of a mesh about ``points`` (N,3), without unit: 1 inside a closed mesh, 0 outside.

    It lies between 0 and 1 for an open mesh, and is negative inside a mesh whose faces point inward. By the fast
    approximation of Barill et al. 2018, exact to about 0.01. About a mesh without triangles it is 0.
    """
    import igl

    if not len(points) or not len(mesh.faces):
        return np.zeros(len(points))
    centre = mesh.bounds.mean(axis=0)
    number = igl.fast_winding_number(
        np.ascontiguousarray(mesh.vertices - centre), np.array(mesh.faces), np.ascontiguousarray(points - centre)
    )
    return np.asarray(number, np.float64).ravel()


def is_inside(points: Floats, mesh: Mesh) -> Flags:
    """Whether each of ``points`` (N,3) lies inside a closed mesh (N,): where its winding number is above 0.5."""
    return winding_number(points, mesh) > 0.5


def signed_distance(points: Floats, mesh: Mesh) -> tuple[Floats, Ints]:
    """Signed distance (N,) of ``points`` (N,3) to a watertight mesh, positive outside, and the nearest triangle (N,).

    The sign is that of the angle-weighted pseudonormal (Baerentzen and Aanaes 2005), exact on a clean watertight mesh.
    Where the nearest place lies on an edge or corner of a flat or slender triangle, or on a vertex that exists twice,
    as CAD tessellations have, or where the mesh folds back on itself, the pseudonormal is unreliable and the winding
    number gives the sign instead.

    Raises ValueError where the mesh has no triangle with an area.
    """
    if not len(points):
        return np.empty(0), np.empty(0, np.int64)
    _require_some(mesh.faces, "triangle")
    require_memory(
        BYTES_OF_POINT * len(points) + BYTES_OF_TRIANGLE * len(mesh.faces),
        f"the distances of {len(points):,} points to {len(mesh.faces):,} triangles",
        FEWER_POINTS + "; or a part with fewer triangles",
    )
    centre = mesh.bounds.mean(axis=0)
    vertices = mesh.vertices - centre
    order = order_by_place(points)
    query = points[order] - centre
    flat, unreliable = _find_faults(mesh)
    # Without the flat triangles the surface is the same set of points, and each triangle has a normal.
    used = np.flatnonzero(~flat)
    _require_some(used, "triangle with an area")
    faces = mesh.faces[used]

    def find_tree() -> Tree:
        # that of plain distances is the same where no triangle is left out
        return build_tree(vertices, faces) if flat.any() else keep_tree(mesh).tree

    kept = keep_signed_mesh(mesh, vertices, faces, find_tree)
    signed, nearest, foot, pseudo = kept.measure(query)
    away = query - foot
    normal = normalise(mesh.cross[used[nearest]])
    beside = np.linalg.norm(np.cross(away, normal), axis=1) > 1e-7 * np.abs(signed)
    # Where the nearest place lies on the short edge of a slender triangle, libigl sometimes gives the normal of that
    # face and not the pseudonormal of the edge: 4 of 70,000 points around a tube with a hole, millimetres from the
    # surface, had the wrong sign.
    doubtful = beside & (np.einsum("ij,ij->i", pseudo, normal) > (1 - 1e-9) * np.linalg.norm(pseudo, axis=1))
    doubtful |= kept.folded[nearest]  # beside a fold also faces, which may be turned inside out
    if unreliable.any():
        doubtful |= beside & unreliable[faces[nearest]].any(axis=1)
    if doubtful.any():
        signed[doubtful] = np.where(kept.wind(query[doubtful]) > 0.5, -1.0, 1.0) * np.abs(signed[doubtful])
    return _undo_order(order, signed), _undo_order(order, used[nearest])


def run_libigl_pass(points: Floats, mesh: Mesh) -> Floats:
    """libigl's signed distance (N,) of ``points`` (N,3) to a watertight mesh, without the corrections of
    `signed_distance` and without moving coordinates to the origin.

    Evaluations use its time as a reference: the least work of a method that compares a scan with CAD point by point.
    Raises ValueError where the mesh has no triangle.
    """
    import igl

    if not len(points):
        return np.empty(0)
    _require_some(mesh.faces, "triangle")
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    return np.asarray(igl.signed_distance(points, mesh.vertices, mesh.faces, sign_type=kind)[0])


def _find_faults(mesh: Mesh) -> tuple[Flags, Flags]:
    """Flat triangles (F,) and unreliable vertices (V,) of a mesh, found once for each mesh."""
    if (known := _faults.get(mesh)) is None:
        flat = _find_flat(mesh, mesh.diagonal)
        known = _faults[mesh] = flat, _find_unreliable_vertices(mesh, flat, mesh.diagonal)
    return known


def _find_flat(mesh: Mesh, scale: float) -> Flags:
    """Whether the height of each triangle over its longest edge (F,) is below what float64 coordinates resolve."""
    triangles = mesh.triangles
    longest = measure_longest_edges(triangles)
    result: Flags = 2 * mesh.face_areas <= 1e-10 * scale * np.maximum(longest, 1e-10 * scale)
    return result


def _find_unreliable_vertices(mesh: Mesh, flat: Flags, scale: float) -> Flags:
    """Whether each vertex (V,) belongs to a flat triangle or lies at the place of another vertex."""
    unreliable = np.zeros(len(mesh.vertices), bool)
    unreliable[mesh.faces[flat]] = True
    cell = np.round((mesh.vertices - mesh.bounds[0]) / (1e-9 * scale))
    used = list_used(mesh.faces)
    inverse = find_duplicates(cell[used])[1]
    unreliable[used[np.bincount(inverse)[inverse] > 1]] = True
    return unreliable
