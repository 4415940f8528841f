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

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part, Solid, Surface
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh, signed_distance
from damageest.geometry.loops import trace_loops
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import concatenate_meshes
from damageest.geometry.undoing import find_crossings
from damageest_cadquery.surfaces._untangle import refine_crossings, untangle

RINGS = 3
"""Rings of triangles by which it reaches beyond the skin."""
CLEAR = 0.4
"""Least distance to the part, in tolerances, that a smoothed rim keeps."""
HORNS = 0.05
"""Largest share of triangles, of those that bound the damage volume, that are taken out as horns."""
SPECK = 0.03
"""Pieces of it with a smaller share of triangles than the largest are left out where they are shallow."""
APART = 4.0
"""Farthest, in tolerances, that a vertex is moved to take a crossing out: most of that is outside the part."""
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


def make_cut(damage: Solid, surface: Surface, part: Part, enclosures: Sequence[Solid], tolerance: float) -> Cut | None:
    """The surface that cuts ``damage`` out of ``part``, with its inner damage ``surface``; None where no enclosure
    bounds it.

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
    cut = _drop_elsewhere(Cut(mesh, signed_distance(mesh.vertices, part)[0], core[chosen]))
    cut = _smooth_outside(_drop_specks(_drop_horns(cut, surface, tolerance), tolerance), part, tolerance)
    if not len(find_crossings(cut.mesh)[0]):
        return cut
    fine, as_it_is = refine_crossings(cut.mesh, tolerance), (cut.mesh, np.arange(len(cut.core)))
    for (mesh, origin), steps in ((fine, 1), (fine, 4), (as_it_is, 1)):  # the first moves least
        apart = untangle(mesh, APART * tolerance, steps)
        if apart is not mesh:
            return Cut(apart, signed_distance(apart.vertices, part)[0], cut.core[origin])
    return cut


def _drop_elsewhere(cut: Cut) -> Cut:
    """The cut without what its continuation reaches of the part elsewhere, as where another site of the same enclosure
    is near."""
    own = np.zeros(len(cut.mesh.vertices), bool)
    own[cut.mesh.faces[cut.core]] = True
    dropped = ((cut.height < 0) & ~own)[cut.mesh.faces].any(axis=1)
    if not dropped.any():
        return cut
    return _take_used(Cut(Mesh(cut.mesh.vertices, cut.mesh.faces[~dropped]), cut.height, cut.core[~dropped]))


def _smooth_outside(cut: Cut, part: Part, tolerance: float) -> Cut:
    """The cut with a smoother rim outside the part, which takes fewer triangles; it comes no nearer to the part."""
    faces, count = cut.mesh.faces, len(cut.mesh.vertices)
    moving = np.ones(count, bool)
    moving[faces[cut.core]] = False
    moving &= cut.height > CLEAR * tolerance
    rim = np.zeros(count, bool)
    edges = find_rim(faces)
    rim[edges] = True
    ends = np.concatenate([faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), edges[:, ::-1]])
    used = moving[ends[:, 0]] & (~rim[ends[:, 0]] | rim[ends[:, 1]])  # along the rim only the rim counts
    graph = coo_array((np.ones(used.sum()), ends[used].T), shape=(count, count)).tocsr()
    total = np.asarray(graph.sum(axis=1)).ravel()
    moving &= total > 1
    vertices = cut.mesh.vertices.copy()
    for _ in range(10):
        vertices[moving] += 0.5 * ((graph @ vertices)[moving] / total[moving, None] - vertices[moving])
    height = cut.height.copy()
    height[moving] = signed_distance(vertices[moving], part)[0]
    back = moving & (height < CLEAR * tolerance)
    vertices[back], height[back] = cut.mesh.vertices[back], cut.height[back]
    return Cut(Mesh(vertices, faces), height, cut.core)


def _drop_horns(cut: Cut, surface: Surface, tolerance: float) -> Cut:
    """The cut without what lies inside the part, but not at the inner damage surface: noise folds an enclosure into
    small horns, which the damage volume does not have. The holes that they leave are closed."""
    off = distance_to_mesh(cut.mesh.vertices, surface)
    away = (cut.height < -tolerance / 4) & (off > tolerance / 2)
    if not away.any():
        return cut
    faces, size = cut.mesh.faces, len(cut.mesh.vertices)
    dropped = away[faces].any(axis=1)
    if dropped.sum() > HORNS * cut.core.sum():
        return cut
    outer = np.zeros(size, bool)
    outer[find_rim(faces)[:, 0]] = True
    for _ in range(8):  # a hole that touches another, or the rim, would pass a vertex twice
        touched = np.zeros(size, bool)
        touched[faces[dropped]] = True
        if (touched & outer).any():
            return cut
        starts = np.bincount(find_rim(faces[~dropped])[:, 0], minlength=size)
        if not (starts > 1).any():
            break
        dropped |= (starts > 1)[faces].any(axis=1)
    else:
        return cut
    left = faces[~dropped]
    loops = [loop for loop in trace_loops(left) if not outer[loop].any()]
    middles = [np.concatenate([cut.mesh.vertices[loop], cut.height[loop, None]], axis=1).mean(axis=0) for loop in loops]
    filled, rim = [], set(map(tuple, find_rim(left).tolist()))
    for number, loop in enumerate(loops):
        ends = np.column_stack([loop, np.roll(loop, -1)])
        if (int(ends[0, 0]), int(ends[0, 1])) in rim:  # in the direction of the triangles: the new ones run against it
            ends = ends[:, ::-1]
        filled.append(np.column_stack([ends, np.full(len(loop), size + number)]))
    more = np.array(middles).reshape(-1, 4)
    mesh = Mesh(np.concatenate([cut.mesh.vertices, more[:, :3]]), np.concatenate([left, *filled]))
    core = np.concatenate([cut.core[~dropped], np.ones(len(mesh.faces) - len(left), bool)])
    return _take_used(Cut(mesh, np.concatenate([cut.height, more[:, 3]]), core))


def find_rim(faces: Ints) -> Ints:
    """(E,2) the directed edges that one triangle has alone."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(faces.max()) + 1
    return edges[~np.isin(edges @ [size, 1], edges @ [1, size])]


def _take_used(cut: Cut) -> Cut:
    used, renumbered = np.unique(cut.mesh.faces, return_inverse=True)
    return Cut(Mesh(cut.mesh.vertices[used], renumbered.reshape(-1, 3)), cut.height[used], cut.core)


def _drop_specks(cut: Cut, tolerance: float) -> Cut:
    """The cut without its smallest shallow pieces: bubbles of a few triangles that noise left in the enclosure."""
    pieces = _split_cut(cut)
    most = max(int(piece.core.sum()) for piece in pieces)
    kept = [piece for piece in pieces if piece.core.sum() > SPECK * most or piece.height.min() < -0.8 * tolerance]
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
        starts = np.bincount(find_rim(faces[chosen])[:, 0], minlength=size)
        pinched = starts > 1
        if not pinched.any():
            return chosen
        chosen |= pinched[faces].any(axis=1)
    return chosen


def _split_cut(cut: Cut) -> list[Cut]:
    """The connected pieces of a cut that bound the damage volume."""
    label = _label_pieces(cut.mesh)
    if label.max() == 0:
        return [cut]
    rows = [np.flatnonzero(label[cut.mesh.faces[:, 0]] == number) for number in range(int(label.max()) + 1)]
    found = [_take_used(Cut(Mesh(cut.mesh.vertices, cut.mesh.faces[own]), cut.height, cut.core[own])) for own in rows]
    return [each for each in found if each.core.any()]


def find_inner(cut: Cut) -> Ints:
    """(N,) the rows of the triangles of a cut that lie inside the part."""
    return np.flatnonzero(cut.core & (cut.height[cut.mesh.faces].mean(axis=1) < 0))


def take_faces(mesh: Mesh, rows: Ints) -> Mesh:
    """Some triangles of a mesh, as a mesh."""
    used, renumbered = np.unique(mesh.faces[rows], return_inverse=True)
    return Mesh(mesh.vertices[used], renumbered.reshape(-1, 3))


def split_mesh(mesh: Mesh) -> list[Mesh]:
    """The connected pieces of a mesh."""
    label = _label_pieces(mesh)
    found = []
    for number in range(int(label.max()) + 1):
        used, renumbered = np.unique(mesh.faces[label[mesh.faces[:, 0]] == number], return_inverse=True)
        found.append(Mesh(mesh.vertices[used], renumbered.reshape(-1, 3)))
    return found


def _label_pieces(mesh: Mesh) -> Ints:
    """(V,) the connected piece of each vertex."""
    count = len(mesh.vertices)
    ends = mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)
