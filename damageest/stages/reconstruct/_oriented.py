"""What reconstructions by other libraries share: oriented points on local fits going in, an open surface coming out."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.errors import StageError

FEWEST = 16
SMOOTHED = 32
"""Points of each local fit."""


def middle(points: Floats) -> Floats:
    """The mean (3,) of points (M,3). Raises StageError where they are too few for a surface."""
    if len(points) < FEWEST:
        raise StageError(f"{len(points)} points are too few for a surface; it takes {FEWEST}", "method: implicit")
    return np.asarray(points.mean(axis=0))


def oriented(points: Floats, part: Part, cell: float, noise: float) -> tuple[Floats, Floats]:
    """Points (M,3), thinned to one in each cube of 0.7 ``cell`` and moved onto local fits, and their unit normals,
    which agree with one another and face the nominal skin rather than not.

    Raises StageError where too few are left.
    """
    from damageest.stages.enclose._fit import smoothed, thinned
    from damageest.stages.enclose._orient import toward_void

    cloud, *_ = thinned(points, 0.7 * cell)
    if len(cloud) < FEWEST:
        raise StageError(
            f"{len(points)} points, {len(cloud)} after thinning, are too few for a surface",
            "a smaller spacing, or method: implicit",
        )
    cloud, normals, _ = smoothed(cloud, noise, min(SMOOTHED, len(cloud) // 2))
    nothing = np.empty((0, 3))
    # The nearest skin may be that behind a thin wall: it breaks the tie between two consistent ways, and no more.
    hint = 1e-4 * _to_skin(cloud, part)
    return cloud, toward_void(cloud, normals, hint, nothing, nothing, np.empty(0), cell)


def opened(vertices: Floats, faces: Ints, cloud: Floats, reach: float, part: Part, tolerance: float) -> Surface:
    """The largest piece (V,3), (F,3) of what lies within ``reach`` of the points, normals toward the lost material.

    Raises StageError where nothing is left.
    """
    from scipy.spatial import cKDTree

    from damageest.stages.reconstruct.pyvista import _largest, _toward_skin
    from damageest.stages.segment.mesh_distance import signed_distance

    if len(faces):
        # What no point vouches for, and what overshoots the part, would bound no lost material.
        near = np.asarray(cKDTree(cloud).query(vertices, workers=2)[0]) < reach
        near &= signed_distance(vertices, part)[0] < 0.5 * tolerance
        faces = _largest(faces[near[faces].all(axis=1)])
    if not len(faces):
        raise StageError("no surface came about", "another spacing, or method: implicit")
    used, faces = np.unique(faces, return_inverse=True)
    surface = Surface(vertices[used], faces.reshape(-1, 3))
    return surface if _toward_skin(surface, part) else Surface(surface.vertices, surface.faces[:, ::-1])


def _to_skin(points: Floats, part: Part) -> Floats:
    """Unit vectors (N,3) to the nearest place on the part; 0 on it."""
    import igl

    origin = part.bounds.mean(axis=0)
    local = np.ascontiguousarray(points - origin)
    _, _, closest = igl.point_mesh_squared_distance(
        local, np.ascontiguousarray(part.vertices - origin), np.array(part.faces)
    )
    step = closest - local
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1), 1e-300)[:, None])
