"""Points on a mesh: at random on its triangles, evenly along edges."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh


def sample_by_area(mesh: Mesh, count: int, rng: np.random.Generator, faces: Ints | None = None) -> tuple[Floats, Ints]:
    """Random points (count,3) on a mesh, evenly by area, and the triangle (count,) of each.

    The cumulative area is divided into ``count`` equal intervals with one point in each (stratified sampling), so that
    every triangle gets its share within one point or two. The triangles come in ascending order of ``faces``.

    Args:
        mesh: open or closed.
        count: number of points.
        rng: source of the random numbers; the same state gives the same points.
        faces: (K,) the triangles to use, all by default.

    Unit and frame are those of the mesh. Raises ValueError where points are wanted and the triangles have no area.
    """
    faces = np.arange(len(mesh.faces)) if faces is None else faces
    total = np.cumsum(2 * mesh.face_areas[faces])
    if not count:
        return np.empty((0, 3)), np.empty(0, np.int64)
    if not len(total) or not total[-1] > 0:
        raise ValueError(f"no place for {count} points on {len(total)} triangles without area")
    at = (np.arange(count) + rng.random(count)) / count * total[-1]
    face = faces[np.minimum(np.searchsorted(total, at), len(total) - 1)]
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(mesh.take_triangles(face), 1, 0)
    return np.asarray(a + u * (b - a) + v * (c - a)), face


def place_along(vertices: Floats, edges: Ints, step: float) -> Floats:
    """Points (M,3) along edges (E,2) between ``vertices`` (V,3), including both ends, at most ``step`` apart."""
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    count = np.ceil(np.linalg.norm(b - a, axis=1) / step).astype(np.int64) + 1
    of = np.repeat(np.arange(len(edges)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count[of] - 1, 1)
    return np.asarray(a[of] + share[:, None] * (b - a)[of])
