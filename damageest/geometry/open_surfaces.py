"""Steps around a surface reconstruction by another library: oriented points before it, a trimmed open surface after it.

Points, part and lengths are in one unit, points and part in the part's frame.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.neighbourhoods import make_tree, query_neighbours, thin_points
from damageest.geometry.orientation import turn_toward_void
from damageest.geometry.threads import count_threads
from damageest.geometry.vectors import normalise

FEWEST = 16
"""Points needed to reconstruct an inner damage surface."""
MOST_CELLS = 3e6
"""Cells in the bounding box of a damage, at most. VTK visits each, in about 2 microseconds."""
FIT_COUNT = 32
"""Neighbours of each local fit."""
NEAREST = 8
"""Points whose mean height moves a vertex."""


def centre_points(points: Floats) -> Floats:
    """The mean (3,) of points (N,3). Raises StageError for fewer than FEWEST points."""
    if len(points) < FEWEST:
        raise StageError(
            f"no inner damage surface could be reconstructed from {len(points)} points; at least {FEWEST} are needed",
            method="implicit",
        )
    return np.asarray(points.mean(axis=0))


def choose_cell(size: Floats, tolerance: float, spacing: float, wanted: float | None = None) -> float:
    """Edge of the cells for a damage whose bounding box along its own axes has the sides ``size`` (3,).

    ``wanted``, where it is given; else the larger of the tolerance and the scan's point spacing, or more where the box
    would need over MOST_CELLS cells.
    """
    least = float(np.prod(size) / MOST_CELLS) ** (1 / 3)
    return wanted or max(tolerance, spacing, least)


def thin_for_surface(points: Floats, cell: float) -> Floats:
    """Points (N,3) thinned to their means (M,3) in cubes of edge 0.7 ``cell``.

    Raises StageError where fewer than FEWEST are left.
    """
    cloud, *_ = thin_points(points, 0.7 * cell)
    if len(cloud) < FEWEST:
        raise StageError(
            f"no inner damage surface could be reconstructed from {len(points)} points, {len(cloud)} after thinning; "
            f"at least {FEWEST} are needed",
            "a smaller spacing",
            method="implicit",
        )
    return cloud


def orient_points(points: Floats, part: Part, cell: float, noise: float) -> tuple[Floats, Floats]:
    """Points (N,3) thinned and moved onto local fits (M,3), and their unit normals (M,3), toward the lost metal.

    The points are thinned as by `thin_for_surface`. The normals agree with one another and, of the two possible
    directions, have the one toward the nominal skin of the part.

    Args:
        points: (N,3) inner-damage-surface points in the part's frame.
        cell: length below which nothing is resolved.
        noise: standard deviation of the points from the surface.

    Raises StageError where fewer than FEWEST are left.
    """
    cloud = thin_for_surface(points, cell)
    cloud, normals, _ = smooth_points(cloud, noise, min(FIT_COUNT, len(cloud) // 2))
    nothing = np.empty((0, 3))
    # The nearest skin may be that behind a thin wall, so its weight is small: it only decides between the two
    # consistent orientations of all normals.
    hint = 1e-6 * _find_skin_directions(cloud, part)
    return cloud, turn_toward_void(cloud, normals, hint, nothing, nothing, np.empty(0), cell)


def draw_to_points(vertices: Floats, faces: Ints, cloud: Floats, normals: Floats) -> Floats:
    """Vertices (V,3) of an open mesh moved by the mean height of the nearest of its points (M,3) over it, along the
    mean of their unit normals (M,3).

    What is reconstructed from the planes through the points lies beside them where it is curved, and wider planes lie
    farther beside. The mesh's own normals would turn from one vertex to the next, and short edges over.
    """
    if not len(faces) or len(cloud) <= NEAREST:
        return vertices
    height = np.einsum("ij,ij->i", cloud - closest_on_mesh(cloud, Surface(vertices, faces)).place, normals)
    far, near = query_neighbours(make_tree(cloud), vertices, NEAREST + 1)
    weight = (1 - far[:, :-1] / np.maximum(far[:, -1:], 1e-300)) ** 2 + 1e-9  # 0 where the next point takes over
    weight /= weight.sum(axis=1, keepdims=True)
    way = normalise(np.einsum("vk,vkj->vj", weight, normals[near[:, :-1]]))
    return np.asarray(vertices + (weight * height[near[:, :-1]]).sum(axis=1)[:, None] * way)


def trim_surface(vertices: Floats, faces: Ints, cloud: Floats, reach: float, part: Part, tolerance: float) -> Surface:
    """The largest piece of a reconstructed mesh near its points, as an inner damage surface, normals toward the lost
    metal.

    Args:
        vertices, faces: (V,3), (F,3) the mesh as reconstructed, closed or open, faces in either direction.
        cloud: (M,3) the points that it was reconstructed from.
        reach: a face stays if its vertices are within this distance of a point.
        part, tolerance: a face stays if its vertices are less than half the tolerance outside the part.

    Raises StageError where nothing is left.
    """
    from scipy.spatial import cKDTree

    if len(faces):
        # Surface far from all points, or outside the part, does not bound lost metal.
        is_near = np.asarray(cKDTree(cloud).query(vertices, workers=count_threads())[0]) < reach
        is_near &= signed_distance(vertices, part)[0] < 0.5 * tolerance
        faces = take_largest_piece(faces[is_near[faces].all(axis=1)])
    if not len(faces):
        raise StageError(
            "the reconstruction gives no inner damage surface near the points inside the part",
            "another spacing",
            method="implicit",
        )
    used, faces = np.unique(faces, return_inverse=True)
    surface = Surface(vertices[used], faces.reshape(-1, 3))
    return surface if faces_skin(surface, part) else Surface(surface.vertices, surface.faces[:, ::-1])


def take_largest_piece(faces: Ints) -> Ints:
    """The largest piece of faces (F,3) whose triangles are connected by edges, as a manifold.

    Triangles at a vertex where two boundary loops touch, or at an edge of more than two triangles, are removed.
    """
    import trimesh

    while len(faces):
        pairs = trimesh.graph.face_adjacency(faces)
        label = trimesh.graph.connected_component_labels(pairs, node_count=len(faces))
        faces = faces[label == np.bincount(label).argmax()]
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        _, inverse, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
        starts, often = np.unique(edges[counts[inverse.reshape(-1)] == 1][:, 0], return_counts=True)
        if often.max(initial=0) <= 1 and counts.max() <= 2:
            break
        touching = np.union1d(starts[often > 1], edges[counts[inverse.reshape(-1)] > 2])
        faces = faces[~np.isin(faces, touching).any(axis=1)]
    return faces


def faces_skin(surface: Surface, part: Part) -> bool:
    """Whether the normals of a surface point to the nearest skin of the part, in the mean over the area."""
    middle = surface.triangles.mean(axis=1)
    step = closest_on_mesh(middle, part).place - middle
    return float(np.einsum("ij,ij->", surface.cross, step)) >= 0


def _find_skin_directions(points: Floats, part: Part) -> Floats:
    """Unit vectors (N,3) from points (N,3) to the nearest place on the part; 0 for a point on it."""
    return normalise(closest_on_mesh(points, part).place - points)
