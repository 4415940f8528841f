"""The skin of a part (its nominal surface) and what of a damage volume lies on it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Part, Solid, Surface
from damageest.geometry.distance import Flags, distance_to_mesh


def find_inner_faces(damage: Solid, part: Part) -> Flags:
    """Which faces (F,) of a damage volume lie inside the part rather than on its skin."""
    corners = damage.triangles
    # Three points inside each triangle: a face of the cut may touch the skin at a corner or along an edge.
    weights = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
    probes = np.einsum("pk,fkj->fpj", weights, corners).reshape(-1, 3)
    distance = distance_to_mesh(probes, part)
    return np.asarray(distance.reshape(-1, 3).max(axis=1) > 1e-7 * part.diagonal)


def extract_ids(damage: Solid, part: Part) -> Surface:
    """The inner damage surface of a damage volume: its faces inside the part, turned toward the lost material."""
    faces = damage.faces[find_inner_faces(damage, part)][:, ::-1]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Surface(damage.vertices[used], renumbered.reshape(-1, 3))
