"""The closed loops that bound an open mesh."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Ints, Surface
from damageest.errors import StageError

SMALL = 10
"""Nodes of a loop that counts as a flaw of the reconstruction, to be closed, and not as a rim (paper 3.2)."""


def trace_loops(faces: Ints) -> list[Ints]:
    """Vertex loops along the boundary edges of faces (F,3), in the direction of their faces; longest first.

    Raises StageError where two loops meet in a vertex, so that they cannot be told apart.
    """
    if not len(faces):
        return []
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(faces.max()) + 1
    lonely = ~np.isin(edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0])
    starts, ends = edges[lonely].T
    if len(np.unique(starts)) != len(starts):
        raise StageError("the surface pinches: two of its rims meet in a point", "another spacing, or method: implicit")
    after = dict(zip(starts.tolist(), ends.tolist(), strict=True))
    found = []
    while after:
        first, node = after.popitem()
        loop = [first]
        while node != first:
            loop.append(node)
            node = after.pop(node)
        found.append(np.array(loop, dtype=np.int64))
    return sorted(found, key=lambda loop: (-len(loop), int(loop.min())))


def trace_rims(surface: Surface) -> list[Ints]:
    """The loops that are no flaws. Raises StageError where there is none."""
    found = [loop for loop in trace_loops(surface.faces) if len(loop) > SMALL]
    if not found:
        raise StageError("the damage surface has no rim: it is closed, or no more than a speck", "method: implicit")
    return found
