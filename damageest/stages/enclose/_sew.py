"""The pieces of an enclosure: extended surface, path on the background, strip between them, cut-off background."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.duplicates import find_members
from damageest.geometry.edges import list_edges
from damageest.geometry.loops import trace_loops
from damageest.geometry.vectors import normalise


@dataclass(frozen=True, eq=False)
class ExtendedSurface:
    """A surface extended beyond its rims. ``loops`` are the new rims; other boundary loops are still to be filled."""

    vertices: Floats
    faces: Ints
    loops: tuple[Ints, ...]


def extend_rims(surface: Surface, rims: Rims, width: float) -> ExtendedSurface:
    """Adds a strip of ``width`` along each rim, in the direction in which the surface ends there.

    Raises StageError where there is no rim.
    """
    if not rims.loops:
        raise StageError("the damage surface has no rim to join to the background", method="implicit")
    vertices, faces, ends = [surface.vertices], [surface.faces], []
    start = len(surface.vertices)
    for loop in rims.loops:
        at = surface.vertices[loop]
        out = point_outward(surface, loop)
        for _ in range(3):
            out = out + np.roll(out, 1, axis=0) + np.roll(out, -1, axis=0)
        out = normalise(out)
        new = np.arange(start, start + len(loop))
        vertices.append(at + width * out)
        before, after = loop, np.roll(loop, -1)
        far, far_after = new, np.roll(new, -1)
        faces.append(np.stack([after, before, far], axis=1))
        faces.append(np.stack([after, far, far_after], axis=1))
        ends.append(new)
        start += len(loop)
    return ExtendedSurface(np.concatenate(vertices), np.concatenate(faces), tuple(ends))


def point_outward(surface: Surface, loop: Ints) -> Floats:
    """Unit vectors (N,3) at the nodes of a rim (N,): the direction in which the surface ends there."""
    at = surface.vertices[loop]
    along = np.roll(at, -2, axis=0) - np.roll(at, 2, axis=0)
    return normalise(np.cross(along, surface.vertex_cross[loop]))


def fill_loops(wide: ExtendedSurface) -> Ints:
    """Faces (F,3) with a fan from one of its nodes in every boundary loop that is not a rim (paper 3.2).

    From the first node whose fan has no edge that the surface has already: an edge of four faces is not closed.
    """
    rim = {int(loop.min()) for loop in wide.loops}
    size = int(wide.faces.max()) + 1
    edges = list_edges(wide.faces)
    known = edges[:, 0] * size + edges[:, 1]
    fans = [wide.faces]
    for loop in trace_loops(wide.faces):
        if int(loop.min()) in rim:
            continue
        for first in range(len(loop)):
            turned = np.roll(loop, -first)
            spokes = np.minimum(turned[0], turned[2:-1]) * size + np.maximum(turned[0], turned[2:-1])
            if not find_members(spokes, known).any():
                break
        fans.append(np.stack([np.full(len(loop) - 2, turned[0]), turned[2:], turned[1:-1]], axis=1))
    return np.concatenate(fans)


@dataclass(frozen=True, eq=False)
class ClosedPath:
    """A closed path of background ``vertices`` (M,), each once. ``station`` (M,), rising: the place on the rim that
    belongs to each, counted in rim nodes."""

    vertices: Ints
    station: Floats


def trace_closed_path(vertices: Floats, faces: Ints, image: Ints) -> ClosedPath:
    """The closed path on a mesh that joins the images (N,) of the rim's nodes, in their order, by shortest paths.

    ``image`` (N,): for each rim node a vertex of the mesh. Raises StageError where fewer than three different vertices
    are left, or where no edges of the mesh join two images.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    after = np.roll(image, -1)
    moves = np.flatnonzero(image != after)
    if len(moves) < 3:
        raise StageError(_COLLAPSED, "a smaller background edge", method="implicit")
    edges = np.unique(list_edges(faces), axis=0)
    used, edges = np.unique(edges, return_inverse=True)
    edges = edges.reshape(-1, 2)
    place = vertices[used]
    image, after = np.searchsorted(used, image), np.searchsorted(used, after)
    length = np.linalg.norm(place[edges[:, 0]] - place[edges[:, 1]], axis=1)
    graph = csr_array((length, (edges[:, 0], edges[:, 1])), shape=(len(used),) * 2)
    slack = 4 * float(length.max())
    walk: list[tuple[int, float]] = []
    for node, here, there in zip(moves.tolist(), image[moves].tolist(), after[moves].tolist(), strict=True):
        gap = float(np.linalg.norm(place[here] - place[there]))
        # Most images are neighbours and their path is short. Across a fold of the background it may be long.
        for limit in (6 * gap + slack, np.inf):
            far, before = dijkstra(graph, directed=False, indices=here, return_predecessors=True, limit=limit)
            if np.isfinite(far[there]):
                break
        if not np.isfinite(far[there]):
            raise StageError("no closed path on the background follows the rim", "background: bbox", method="implicit")
        path = [there]
        while path[-1] != here:
            path.append(int(before[path[-1]]))
        walk += [(step, node + k / (len(path) - 1)) for k, step in enumerate(path[:0:-1])]
    walk = _simplify_walk(walk)
    return ClosedPath(used[[step for step, _ in walk]], np.array([station for _, station in walk]))


_COLLAPSED = "the rim shrinks to a point on the background"


def _simplify_walk(walk: list[tuple[int, float]]) -> list[tuple[int, float]]:
    """The closed walk without detours: of two loops that meet in a vertex, the longer one stays.

    Raises StageError where fewer than three vertices are left.
    """
    while True:
        seen: dict[int, int] = {}
        for place, (node, _) in enumerate(walk):
            if node in seen:
                inner = walk[seen[node] : place]
                outer = walk[: seen[node]] + walk[place:]
                walk = inner if len(inner) > len(outer) else outer
                break
            seen[node] = place
        else:
            break
    if len(walk) < 3:
        raise StageError(_COLLAPSED, "a smaller background edge", method="implicit")
    return walk


def build_strip(loop: Ints, path: ClosedPath, start: int) -> Ints:
    """Triangles (N + M,3) between a rim (N,) and its path on the background (M,), whose vertices are numbered from
    ``start`` on. Each rim node is joined to its image and to the path halfway to the next image (paper 3.2)."""
    n, m = len(loop), len(path.vertices)
    # Go along both by their stations; each step makes one triangle. Halfway between two rim nodes the next one begins.
    steps = np.concatenate([np.arange(n) + 0.5, path.station[1:], [n + path.station[0]]])
    which = np.argsort(steps, kind="stable")
    is_first = which < n
    i = np.concatenate([[0], np.cumsum(is_first)])[:-1]
    j = np.concatenate([[0], np.cumsum(~is_first)])[:-1]
    a, a_next = loop[i % n], loop[(i + 1) % n]
    b, b_next = path.vertices[j % m] + start, path.vertices[(j + 1) % m] + start
    return np.where(is_first[:, None], np.stack([a_next, a, b], axis=1), np.stack([a, b, b_next], axis=1))


def cut_off(faces: Ints, paths: list[Ints], against: bool) -> Ints | None:
    """Of a closed mesh, the faces on one side of the closed paths (M,): the side whose edges run along the paths, or
    ``against`` them; None where the paths do not split the mesh there."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = int(faces.max()) + 1
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    code, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    along = np.concatenate([c * size + np.roll(c, -1) for c in paths])
    counter = np.concatenate([np.roll(c, -1) * size + c for c in paths])
    order = np.argsort(code)
    twin = order[np.searchsorted(code[order], back)]
    cut = find_members(code, along) | find_members(code, counter)
    owner = np.arange(len(edges)) // 3
    links = coo_array((np.ones((~cut).sum()), (owner[~cut], owner[twin[~cut]])), shape=(len(faces),) * 2)
    _, piece = connected_components(links, directed=False)
    # Where the surface is turned over, its rim runs the other way, and so must the side that is joined to it.
    wanted = np.unique(piece[owner[find_members(code, along if against else counter)]])
    unwanted = np.unique(piece[owner[find_members(code, counter if against else along)]])
    if np.intersect1d(wanted, unwanted).size:
        return None
    return np.asarray(faces[np.isin(piece, wanted)])
