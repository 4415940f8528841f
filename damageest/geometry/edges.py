"""The edges of triangles."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Ints


def list_edges(faces: Ints) -> Ints:
    """(3F,2) the edges of triangles (F,3), the lower vertex first: three of the first triangle, then of the next."""
    return np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)


def pair_faces(faces: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """For each edge (E,) of a closed mesh: its ends, and the two faces at it; it runs from the first to the second end
    in the first face."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.argsort(low * (int(faces.max()) + 1) + high, kind="stable")
    one, other = order[0::2], order[1::2]
    return edges[one, 0], edges[one, 1], one // 3, other // 3
