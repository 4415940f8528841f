"""What reconstructions by other libraries share: oriented points on local fits going in, an open surface coming out."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.neighbourhoods import thin_points
from damageest.geometry.orientation import turn_toward_void

FEWEST = 16
SMOOTHED = 32
"""Points of each local fit."""


def centre_points(points: Floats) -> Floats:
    """The mean (3,) of points (M,3). Raises StageError where they are too few for a surface."""
    if len(points) < FEWEST:
        raise StageError(f"{len(points)} points are too few for a surface; it takes {FEWEST}", "method: implicit")
    return np.asarray(points.mean(axis=0))


def thin_for_surface(points: Floats, cell: float) -> Floats:
    """Points (M,3) thinned to one in each cube of 0.7 ``cell``. Raises StageError where too few are left."""
    cloud, *_ = thin_points(points, 0.7 * cell)
    if len(cloud) < FEWEST:
        raise StageError(
            f"{len(points)} points, {len(cloud)} after thinning, are too few for a surface",
            "a smaller spacing, or method: implicit",
        )
    return cloud


def orient_points(points: Floats, part: Part, cell: float, noise: float) -> tuple[Floats, Floats]:
    """Points (M,3), thinned to one in each cube of 0.7 ``cell`` and moved onto local fits, and their unit normals,
    which agree with one another and face the nominal skin rather than not.

    Raises StageError where too few are left.
    """

    cloud = thin_for_surface(points, cell)
    cloud, normals, _ = smooth_points(cloud, noise, min(SMOOTHED, len(cloud) // 2))
    nothing = np.empty((0, 3))
    # The nearest skin may be that behind a thin wall: it breaks the tie between two consistent ways, and no more.
    hint = 1e-4 * _to_skin(cloud, part)
    return cloud, turn_toward_void(cloud, normals, hint, nothing, nothing, np.empty(0), cell)


def trim_surface(vertices: Floats, faces: Ints, cloud: Floats, reach: float, part: Part, tolerance: float) -> Surface:
    """The largest piece (V,3), (F,3) of what lies within ``reach`` of the points, normals toward the lost material.

    Raises StageError where nothing is left.
    """
    from scipy.spatial import cKDTree

    if len(faces):
        # What no point vouches for, and what overshoots the part, would bound no lost material.
        near = np.asarray(cKDTree(cloud).query(vertices, workers=2)[0]) < reach
        near &= signed_distance(vertices, part)[0] < 0.5 * tolerance
        faces = take_largest_piece(faces[near[faces].all(axis=1)])
    if not len(faces):
        raise StageError("no surface came about", "another spacing, or method: implicit")
    used, faces = np.unique(faces, return_inverse=True)
    surface = Surface(vertices[used], faces.reshape(-1, 3))
    return surface if faces_skin(surface, part) else Surface(surface.vertices, surface.faces[:, ::-1])


def take_largest_piece(faces: Ints) -> Ints:
    """The largest piece whose triangles hang together by edges, without corners where two rims touch."""
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
        bad = np.union1d(starts[often > 1], edges[counts[inverse.reshape(-1)] > 2])
        faces = faces[~np.isin(faces, bad).any(axis=1)]
    return faces


def faces_skin(surface: Surface, part: Part) -> bool:
    """Whether the normals point to the nominal skin nearest to them, by area."""
    middle = surface.triangles.mean(axis=1)
    step = closest_on_mesh(middle, part).place - middle
    return float(np.einsum("ij,ij->", surface.cross, step)) >= 0


def _to_skin(points: Floats, part: Part) -> Floats:
    """Unit vectors (N,3) to the nearest place on the part; 0 on it."""
    step = closest_on_mesh(points, part).place - points
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1), 1e-300)[:, None])
