"""A plain non-rigid fit to compare with: iterated closest points with a cubic polynomial, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from damageest.artefacts import Floats, Mesh, Part
from damageest.geometry.barycentric import find_barycentric
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.refinement import cut_part

ROUNDS = 20
FINE = 40.0
"""Edges along the part's diagonal of the triangles that are moved."""
USED = 12_000
"""Points, about, that it is fitted to."""


def fit_plainly(part: Part, points: Floats) -> Part:
    """The part, deformed so that all points (N,3) in its frame lie on it as nearly as possible, point to plane."""
    centre, size = part.bounds.mean(axis=0), float(np.ptp(part.bounds, axis=0).max()) / 2
    powers = np.array([p for p in product(range(4), repeat=3) if sum(p) <= 3])

    def evaluate(places: Floats) -> Floats:
        q = (places - centre) / size
        return np.asarray(np.prod(q[:, None, :] ** powers, axis=2))

    mesh = cut_part(part, part.diagonal / FINE)
    used, moved = points[:: max(1, len(points) // USED)], mesh.vertices
    for _ in range(ROUNDS):
        now = Mesh(moved, mesh.faces)
        _, face, place = closest_on_mesh(used, now)
        normal = now.face_normals[face]
        at = np.einsum("nk,nkj->nj", find_barycentric(now.triangles[face], place), mesh.triangles[face])
        rows = (evaluate(at)[:, :, None] * normal[:, None, :]).reshape(len(used), -1)
        target = np.einsum("ij,ij->i", normal, used - at)
        found = np.linalg.lstsq(rows, target, rcond=1e-8)[0]
        moved = mesh.vertices + evaluate(mesh.vertices) @ found.reshape(-1, 3)
    return replace(mesh, vertices=moved, cad_scale=0.0)
