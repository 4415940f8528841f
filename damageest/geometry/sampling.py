"""Points spread over the triangles of a mesh."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh


def sample_by_area(mesh: Mesh, count: int, rng: np.random.Generator, faces: Ints | None = None) -> tuple[Floats, Ints]:
    """``count`` random points (count,3) spread evenly by area over a mesh, and the triangle (count,) of each.

    Each point falls into its own one of ``count`` equal stretches of the summed area, so that the points leave neither
    clumps nor holes between triangles. ``faces`` (K,): the triangles to take; all by default. Their area must not be 0.
    """
    faces = np.arange(len(mesh.faces)) if faces is None else faces
    total = np.cumsum(np.linalg.norm(mesh.cross[faces], axis=1))
    at = (np.arange(count) + rng.random(count)) / count * total[-1]
    face = faces[np.minimum(np.searchsorted(total, at), len(total) - 1)]
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(mesh.triangles[face], 1, 0)
    return np.asarray(a + u * (b - a) + v * (c - a)), face
