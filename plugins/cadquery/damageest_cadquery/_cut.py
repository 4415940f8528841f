"""The open surface that cuts a damage volume out of the part: its inner damage surface, continued through the skin.

Continued by the enclosure's own triangles, it ends outside the part, so a Boolean with the part's solids needs no more
of the enclosure than this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part, Solid
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import concatenate_meshes

RINGS = 3
"""Rings of triangles by which it reaches beyond the skin."""
SPECK = 0.03
"""Pieces of it with a smaller share of triangles than the largest are left out."""
ISLAND = 0.1
"""Triangles left out among those of the cut are taken in where they are fewer than this share of it."""


@dataclass(frozen=True, eq=False)
class Cut:
    """``mesh``: an open surface, normals out of the damage volume. ``height`` (V,): signed distance of its vertices to
    the part's skin, positive outside. ``core`` (F,): the triangles that bound the damage volume."""

    mesh: Mesh
    height: Floats
    core: Flags

    @property
    def inner(self) -> Floats:
        """(K,3) its vertices inside the part, which bound the damage volume."""
        return np.asarray(self.mesh.vertices[np.unique(self.mesh.faces[self.core])][self.height[self._core_rows] <= 0])

    @property
    def _core_rows(self) -> Ints:
        return np.unique(self.mesh.faces[self.core])


def make_cut(damage: Solid, part: Part, enclosures: Sequence[Solid]) -> Cut | None:
    """The surface that cuts ``damage`` out of ``part``; None where no enclosure bounds it.

    All are in one unit and the part's frame.
    """
    inner = find_inner_faces(damage, part)
    if not enclosures or not inner.any():
        return None
    vertices, faces, _ = concatenate_meshes(enclosures)
    whole = Mesh(vertices, faces)
    off, face, _ = closest_on_mesh(damage.triangles[inner].mean(axis=1), whole)
    used = np.unique(face[off <= 1e-6 * part.diagonal])
    if not len(used):
        return None
    core = np.zeros(len(faces), bool)
    core[used] = True
    chosen, touched = core.copy(), np.zeros(len(vertices), bool)
    for _ in range(RINGS):
        touched[faces[chosen]] = True
        chosen |= touched[faces].any(axis=1)
    chosen = _close_gaps(faces, chosen)
    rows, renumbered = np.unique(faces[chosen], return_inverse=True)
    mesh = Mesh(vertices[rows], renumbered.reshape(-1, 3))
    return _drop_specks(Cut(mesh, signed_distance(mesh.vertices, part)[0], core[chosen]))


def _drop_specks(cut: Cut) -> Cut:
    """The cut without its smallest pieces: bubbles of a few triangles that noise left in the enclosure."""
    pieces = split_cut(cut)
    most = max(int(piece.core.sum()) for piece in pieces)
    kept = [piece for piece in pieces if piece.core.sum() > SPECK * most]
    if len(kept) == len(pieces):
        return cut
    vertices, faces, _ = concatenate_meshes([piece.mesh for piece in kept])
    height, core = (np.concatenate([getattr(piece, name) for piece in kept]) for name in ("height", "core"))
    return Cut(Mesh(vertices, faces), height, core)


def _close_gaps(faces: Ints, chosen: Flags) -> Flags:
    """The chosen triangles of a closed mesh with the small islands among them, and with those round a vertex in which
    two rims would touch."""
    for _ in range(4):
        left = np.flatnonzero(~chosen)
        if not len(left):
            return chosen
        corner = np.repeat(np.arange(len(left)), 3)
        size = int(faces.max()) + 1
        # triangles that share a vertex
        graph = coo_array(
            (np.ones(len(corner), bool), (corner, len(left) + faces[left].ravel())), shape=(len(left) + size,) * 2
        )
        label = connected_components(graph, directed=False)[1][: len(left)]
        count = np.bincount(label)
        small = (count < ISLAND * chosen.sum()) & (count < count.max())
        chosen = chosen.copy()
        chosen[left[small[label]]] = True
        edges = np.concatenate([faces[chosen][:, [0, 1]], faces[chosen][:, [1, 2]], faces[chosen][:, [2, 0]]])
        codes, opposite = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
        starts = np.bincount(edges[~np.isin(codes, opposite), 0], minlength=size)
        pinched = starts > 1
        if not pinched.any():
            return chosen
        chosen |= pinched[faces].any(axis=1)
    return chosen


def split_cut(cut: Cut) -> list[Cut]:
    """The connected pieces of a cut."""
    count = len(cut.mesh.vertices)
    ends = cut.mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count))
    pieces, label = connected_components(graph, directed=False)
    if pieces == 1:
        return [cut]
    found = []
    for number in range(pieces):
        own = label[cut.mesh.faces[:, 0]] == number
        used, renumbered = np.unique(cut.mesh.faces[own], return_inverse=True)
        mesh = Mesh(cut.mesh.vertices[used], renumbered.reshape(-1, 3))
        found.append(Cut(mesh, cut.height[used], cut.core[own]))
    return [each for each in found if each.core.any()]


def decimate(cut: Cut, count: int) -> Mesh | None:
    """The cut with about ``count`` triangles, fitted to its vertices; None where it cannot be made manifold."""
    import pyvista as pv

    mesh = cut.mesh
    if len(mesh.faces) > count:
        cells = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).ravel()
        poly = pv.PolyData(np.asarray(mesh.vertices, np.float64), cells)
        less = poly.decimate(1 - count / len(mesh.faces), volume_preservation=False)
        less = Mesh(np.asarray(less.points, np.float64), np.asarray(less.faces.reshape(-1, 4)[:, 1:], np.int64))
    else:
        less = mesh
    return fit_vertices(less, mesh.vertices)


def fit_vertices(mesh: Mesh, points: Floats, stiff: float = 1e-2) -> Mesh:
    """Moves vertices along their normals so that triangles pass through ``points`` (N,3) by least squares: without it,
    chords over a curved surface lie all on one side."""
    from scipy.sparse import csr_array, eye_array, vstack
    from scipy.sparse.linalg import lsqr

    _, face, place = closest_on_mesh(points, mesh)
    corners = mesh.triangles[face]
    weights = barycentric(place, corners)
    along = mesh.face_normals[face]
    offset = np.einsum("ij,ij->i", points - place, along)
    normal = mesh.vertex_normals
    tilt = np.einsum("nkj,nj->nk", normal[mesh.faces[face]], along)
    rows = np.repeat(np.arange(len(points)), 3)
    A = csr_array(((weights * tilt).ravel(), (rows, mesh.faces[face].ravel())), shape=(len(points), len(mesh.vertices)))
    size = np.sqrt(len(points) / len(mesh.vertices)) * stiff
    A = vstack([A, size * eye_array(len(mesh.vertices))]).tocsr()
    b = np.concatenate([offset, np.zeros(len(mesh.vertices))])
    step = np.asarray(lsqr(A, b, atol=1e-8, btol=1e-8, iter_lim=200)[0])
    return Mesh(mesh.vertices + step[:, None] * normal, mesh.faces)


def barycentric(points: Floats, corners: Floats) -> Floats:
    """(N,3) weights of ``points`` (N,3) in triangles ``corners`` (N,3,3)."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    s, t = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
    return np.stack([1 - s - t, s, t], axis=1)


def count_bad_edges(faces: Ints) -> int:
    """Edges with more than two triangles, or with two that run through them in the same direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(faces.max()) + 1
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(size, size)).tocsr()
    graph.sum_duplicates()
    return int((graph.data > 1).sum())
