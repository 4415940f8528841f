"""The boundary loops of an open mesh, and which of them are rims."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Ints, Surface
from damageest.errors import StageError
from damageest.geometry.duplicates import find_members

MOST_FLAW_VERTICES = 10
"""Vertices up to which a boundary loop is a flaw of the reconstruction, to be closed, and not a rim (paper 3.2)."""


def trace_loops(faces: Ints) -> list[Ints]:
    """The boundary loops of faces (F,3), each an array of vertex indices; most vertices first.

    A loop runs in the direction of its faces; its last vertex is followed by the first. A closed mesh has none. The
    mesh must be a manifold with consistent windings.

    Raises StageError where two loops meet in a vertex, because they cannot be separated.
    """
    if not len(faces):
        return []
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(faces.max()) + 1
    is_boundary = ~find_members(edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0])
    starts, ends = edges[is_boundary].T
    if len(np.unique(starts)) != len(starts):
        raise StageError(
            "two boundary loops of the surface meet in a point and cannot be separated",
            "another spacing",
            method="implicit",
        )
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
    """The boundary loops of more than MOST_FLAW_VERTICES vertices, as `trace_loops` gives them.

    Raises StageError where there is none, or where two loops meet in a vertex.
    """
    found = [loop for loop in trace_loops(surface.faces) if len(loop) > MOST_FLAW_VERTICES]
    if not found:
        raise StageError(
            "the damage surface has no rim: it is closed, or none of its boundary loops has more than "
            f"{MOST_FLAW_VERTICES} vertices",
            method="implicit",
        )
    return found
