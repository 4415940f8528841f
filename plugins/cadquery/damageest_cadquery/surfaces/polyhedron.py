"""A surface of few flat faces: recognised planes as one face each, triangles elsewhere.

Vertices that bound a plane are moved onto it, and where planes meet onto their common edge, before the surface is
simplified: quadric errors then keep planes and edges. M. Garland, P. Heckbert, "Surface simplification using quadric
error metrics", 1997.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.spatial
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array, vstack
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import lsqr

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.barycentric import find_barycentric
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.edges import list_edges
from damageest_cadquery.surfaces._recognise import ALIKE, Shape, find_neighbours
from damageest_cadquery.surfaces._untangle import keep_apart
from damageest_cadquery.surfaces.flat_faces import Flat, split_regions
from damageest_cadquery.surfaces.open_surface import Cut

SMALL = 20
"""Triangles of a region of a plane below which it is not kept as a face of its own."""
FINE = 10_000
"""Triangles down to which a surface is simplified without a check that they do not cross."""
PROBES = 4000
"""Points at which a simplified surface is measured before it is tried."""
PER_TRIANGLE = 12
"""Points for each triangle to which the simplified surface is fitted."""
LEAST_FREE = 0.25
"""Share of a surface for which the rest of it is shifted further."""
_RANK = 0.05
"""Singular values of the normals below which planes are taken to be parallel."""
_STIFF = 0.05


def mark_planes(cut: Cut, inner: Ints, label: Ints, shapes: Sequence[Shape], tolerance: float) -> Flat:
    """The cut with its vertices moved onto the planes that its triangles belong to.

    ``inner`` (N,): rows of the cut's triangles that have a ``label`` (N,), the number of their shape or -1.
    """
    kept = [k for k, shape in enumerate(shapes) if shape.kind == "plane"]
    planes = [shapes[k] for k in kept]
    full = np.full(len(cut.mesh.faces), -1, np.int64)
    if not planes:
        return Flat(cut.mesh, full, ())
    number = np.full(len(shapes) + 1, -1)
    number[kept] = np.arange(len(kept))
    full[inner] = number[label]
    centres, normals = cut.mesh.triangles.mean(axis=1), cut.mesh.face_normals
    off = np.abs(np.stack([plane.measure(centres)[0] for plane in planes]))
    along = np.abs(np.stack([normals @ plane.axis for plane in planes]))
    outside = np.setdiff1d(np.arange(len(full)), inner)
    near = np.where(along[:, outside] >= ALIKE, off[:, outside], np.inf)
    nearest = near.argmin(axis=0)
    full[outside] = np.where(near[nearest, np.arange(len(outside))] < tolerance / 3, nearest, -1)
    full = _smooth_labels(cut.mesh.faces, full, off < tolerance / 2)
    full = _drop_small(cut.mesh.faces, full)
    flat = _settle(Flat(cut.mesh, full, planes), tolerance)
    return Flat(_relax(flat), flat.label, planes)


def decimate(flat: Flat, count: int) -> Flat:
    """The surface with about ``count`` triangles, which do not cross one another."""
    mesh = flat.mesh
    if len(mesh.faces) <= count:
        return flat
    if len(mesh.faces) > FINE > count:
        flat = _collapse(flat, FINE, False)
    return _collapse(flat, count, True)


def _collapse(flat: Flat, count: int, apart: bool) -> Flat:
    """``apart``: whether triangles are kept from crossing one another, which takes ten times as long."""
    import igl

    V, F, birth, _ = igl.qslim(
        np.ascontiguousarray(flat.mesh.vertices), np.ascontiguousarray(flat.mesh.faces, np.int32), count, apart
    )
    if not len(F):  # it refuses surfaces of which a vertex joins two sheets
        apart_there = split_sheets(flat.mesh)
        if len(apart_there.vertices) == len(flat.mesh.vertices):
            return flat
        return _collapse(Flat(apart_there, flat.label, flat.planes), count, apart)
    return Flat(Mesh(np.asarray(V, np.float64), np.asarray(F, np.int64)), flat.label[np.asarray(birth)], flat.planes)


def split_sheets(mesh: Mesh) -> Mesh:
    """The mesh with a vertex of its own for each sheet where several meet in one: sheets are triangles round a vertex
    that follow each other by edges."""
    import igl

    vertices, faces, _ = igl.split_nonmanifold(mesh.vertices, mesh.faces)
    return Mesh(vertices, faces)


def fit(flat: Flat, cut: Cut, tolerance: float) -> Flat:
    """A simplified surface fitted to vertices of the cut."""
    mesh, label = flat.mesh, flat.label
    bounds = _find_bounds(mesh.faces, label, len(flat.planes), len(mesh.vertices))
    free = np.asarray(~bounds.any(axis=1))
    mesh = _fit_vertices(mesh, free, thin_points(cut.mesh.vertices, PER_TRIANGLE * len(mesh.faces)), tolerance)
    mesh = keep_apart(mesh, flat.mesh.vertices)
    return _settle(Flat(mesh, label, flat.planes), tolerance)


def shift_free(flat: Flat, step: float) -> Flat:
    """The surface with the vertices that bound no plane moved along their normals, by more than ``step`` where others
    stay: on average it is moved by that."""
    mesh = flat.mesh
    free = np.asarray(~_find_bounds(mesh.faces, flat.label, len(flat.planes), len(mesh.vertices)).any(axis=1))
    areas = 2 * mesh.face_areas
    share = float(areas @ free[mesh.faces].mean(axis=1)) / max(float(areas.sum()), 1e-300)
    step /= max(share, LEAST_FREE)
    return Flat(Mesh(mesh.vertices + step * free[:, None] * mesh.vertex_normals, mesh.faces), flat.label, flat.planes)


def _settle(flat: Flat, tolerance: float) -> Flat:
    """Moves vertices onto the planes that they bound. Where these have no common point near, as planes that are almost
    parallel, triangles of the smallest of them leave it."""
    faces, label = flat.mesh.faces, flat.label
    if not len(flat.planes):
        return flat
    area = 2 * flat.mesh.face_areas
    for _ in range(12):
        bounds = _find_bounds(faces, label, len(flat.planes), len(flat.mesh.vertices))
        moved = _project(flat.mesh.vertices, bounds, flat.planes)
        off = np.abs(np.stack([plane.measure(moved)[0] for plane in flat.planes], axis=1))
        bad = (bounds & (off > 1e-9 * flat.mesh.diagonal)).any(axis=1)
        bad |= np.linalg.norm(moved - flat.mesh.vertices, axis=1) > tolerance
        if not bad.any():
            break
        sizes = np.bincount(label[label >= 0], weights=area[label >= 0], minlength=len(flat.planes))
        leave = np.where(bounds[bad], sizes, np.inf).argmin(axis=1)
        number = np.full(len(moved), -2)
        number[bad] = leave
        label = np.where((number[faces] == label[:, None]).any(axis=1), -1, label)
    else:
        label = np.full(len(faces), -1)
        moved = flat.mesh.vertices
    faces, label = _weld(moved, faces, label)
    bounds = _find_bounds(faces, label, len(flat.planes), len(moved))
    within = np.asarray(bounds[faces].all(axis=1)).T  # (K,F): all corners of a triangle lie on a plane, so it does
    return Flat(Mesh(moved, faces), _smooth_labels(faces, label, within, 1), flat.planes)


def _weld(vertices: Floats, faces: Ints, label: Ints) -> tuple[Ints, Ints]:
    """Triangles and labels without those that have lost an edge: corners of planes at which several vertices meet."""
    close = scipy.spatial.cKDTree(vertices).query_pairs(
        1e-7 * float(np.linalg.norm(np.ptp(vertices, axis=0))), output_type="ndarray"
    )
    if not len(close):
        return faces, label
    graph = coo_array((np.ones(len(close), bool), (close[:, 0], close[:, 1])), shape=(len(vertices),) * 2)
    _, first, same = np.unique(connected_components(graph, directed=False)[1], return_index=True, return_inverse=True)
    faces = first[same.reshape(-1)[faces]]
    a, b, c = faces.T
    kept = (a != b) & (b != c) & (c != a)
    return faces[kept], label[kept]


def _relax(flat: Flat, rounds: int = 12) -> Mesh:
    """Spreads the vertices within planes and along their common edges, so that no triangle there is folded."""
    faces, count = flat.mesh.faces, len(flat.mesh.vertices)
    if not len(flat.planes):
        return flat.mesh
    bounds = _find_bounds(faces, flat.label, len(flat.planes), count)
    fixed = np.zeros(count, bool)
    fixed[faces[flat.label < 0]] = True
    ends = np.unique(list_edges(faces), axis=0)
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    code, times = np.unique(np.sort(directed, axis=1) @ [count, 1], return_counts=True)
    rim = code[times == 1]
    fixed[rim // count] = True
    fixed[rim % count] = True
    # a vertex on a common edge moves along it only
    one, two = np.concatenate([ends, ends[:, ::-1]]).T
    follows = (bounds[one] <= bounds[two]).all(axis=1) & ~fixed[one]
    graph = coo_array((np.ones(follows.sum()), (one[follows], two[follows])), shape=(count, count)).tocsr()
    total = np.asarray(graph.sum(axis=1)).ravel()
    moving = total > 1
    vertices = flat.mesh.vertices.copy()
    for _ in range(rounds):
        mean = (graph @ vertices)[moving] / total[moving, None]
        vertices[moving] += 0.6 * (mean - vertices[moving])
    return Mesh(_project(vertices, bounds, flat.planes), faces)


def thin_points(points: NDArray[Any], most: int) -> NDArray[Any]:
    """At most so many of points (N,...), spread evenly over their order."""
    return points if len(points) <= most else points[np.linspace(0, len(points) - 1, most).astype(int)]


@dataclass(frozen=True, eq=False)
class Probes:
    """Points (N,3) of a surface, with the ``areas`` (N,) that they stand for."""

    points: Floats
    areas: Floats

    def measure_beyond(self, flat: Flat, far: float) -> float:
        """The share of the area that a simplified surface passes at more than ``far``."""
        if not len(self.points):
            return 0.0
        some = thin_points(np.arange(len(self.points)), PROBES)
        beyond = distance_to_mesh(self.points[some], flat.mesh) > far
        return float(self.areas[some][beyond].sum() / self.areas[some].sum())


def _smooth_labels(faces: Ints, label: Ints, allowed: Flags, least: int = 2) -> Ints:
    """Labels without single triangles among those of another: where at least so many neighbours agree, they win.
    ``allowed`` (K,F) says which planes a triangle may belong to."""
    one, two = find_neighbours(faces)
    rows = np.arange(len(faces))
    for _ in range(6):
        votes = np.zeros((len(allowed) + 1, len(faces)), np.int64)
        np.add.at(votes, (label[one], two), 1)
        np.add.at(votes, (label[two], one), 1)
        votes[:-1][~allowed] = 0
        best = votes[:-1].argmax(axis=0)
        strong = (votes[best, rows] >= least) & ((votes[best, rows] > votes[label, rows]) | ((label < 0) & (least < 2)))
        strong &= (label < 0) | (least >= 2)
        if not strong.any():
            break
        label = np.where(strong, best, label)
    return label


def _drop_small(faces: Ints, label: Ints) -> Ints:
    region = split_regions(faces, label)
    return np.where(np.bincount(region)[region] < SMALL, -1, label)


def _find_bounds(faces: Ints, label: Ints, planes: int, count: int) -> Flags:
    """(V,K) the planes that each vertex bounds."""
    bounds = np.zeros((count, planes + 1), bool)
    bounds[faces.ravel(), np.repeat(label, 3)] = True
    return bounds[:, :planes]


def _project(vertices: Floats, bounds: Flags, planes: Sequence[Shape]) -> Floats:
    """The vertices moved the shortest way onto all planes that they bound; stays where these have no common point."""
    moved = vertices.copy()
    if not planes:
        return moved
    axes = np.array([plane.axis for plane in planes])
    height = np.array([plane.axis @ plane.point for plane in planes])
    patterns, which = np.unique(bounds, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        if pattern.any():
            rows = np.flatnonzero(which.reshape(-1) == k)
            N = axes[pattern]
            step = (height[pattern] - moved[rows] @ N.T) @ np.linalg.pinv(N, rcond=_RANK).T
            moved[rows] += step
    return moved


def _fit_vertices(mesh: Mesh, free: Flags, points: Floats, tolerance: float) -> Mesh:
    """Moves ``free`` (V,) vertices along their normals, by less than half the tolerance, so that triangles pass through
    ``points`` (N,3) by least squares: without it, chords over a curved surface lie all on one side."""
    _, face, place = closest_on_mesh(points, mesh)
    weights = find_barycentric(mesh.triangles[face], place, clip=False)
    along = mesh.face_normals[face]
    offset = np.einsum("ij,ij->i", points - place, along)
    normal = mesh.vertex_normals
    tilt = np.einsum("nkj,nj->nk", normal[mesh.faces[face]], along) * free[mesh.faces[face]]
    rows = np.repeat(np.arange(len(points)), 3)
    A = csr_array(((weights * tilt).ravel(), (rows, mesh.faces[face].ravel())), shape=(len(points), len(mesh.vertices)))
    size = np.sqrt(len(points) / len(mesh.vertices)) * _STIFF
    A = vstack([A, size * eye_array(len(mesh.vertices))]).tocsr()
    b = np.concatenate([offset, np.zeros(len(mesh.vertices))])
    step = np.clip(lsqr(A, b, atol=1e-6, btol=1e-6, iter_lim=100)[0], -tolerance / 2, tolerance / 2) * free
    return Mesh(mesh.vertices + step[:, None] * normal, mesh.faces)
