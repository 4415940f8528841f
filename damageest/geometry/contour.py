"""The solid inside a distance function's zero level, sampled on a voxel grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.errors import StageError
from damageest.geometry.isosurface import extract_region
from damageest.geometry.poisson import Grid

BLOCK = 6
"""Nodes along each axis of the blocks in which the function is first evaluated once."""
MOST_NODES = 60_000_000
"""Nodes of a grid in memory at once, at about 12 bytes each."""


def extract_contour(
    distance: Callable[[Floats], Floats], low: Floats, shape: tuple[int, int, int], cell: float
) -> Solid:
    """The solid where ``distance`` is negative, by marching cubes on a voxel grid; the walls of the grid close it.

    Args:
        distance: takes points (N,3) and gives signed values (N,) that change by no more than the points move
            (Lipschitz constant 1), as a signed distance does. It is called with many points at once.
        low: (3,) the grid's lowest node.
        shape: how many nodes the grid has along x, y and z.
        cell: the grid spacing.

    ``low``, ``cell`` and the values are lengths in one unit, ``low`` in the frame of the points; so is the solid. The
    function is evaluated once per block of nodes, and at each node only in blocks that the zero level may cross.

    Raises StageError where the grid would not fit in memory (see MOST_NODES), or where no node is inside.
    """
    if (nodes := int(np.prod(shape))) > MOST_NODES:
        raise StageError(
            f"a voxel grid of {nodes:,} nodes, {cell:.3g} apart, does not fit in memory; at most {MOST_NODES:,} do",
            f"a cell of {cell * (nodes / MOST_NODES) ** (1 / 3) * 1.05:.3g} or more, or method: implicit",
        )
    blocks = [-(-n // BLOCK) for n in shape]
    index = np.stack(np.meshgrid(*(np.arange(n) for n in blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    middle = distance(low + cell * (BLOCK * index + (BLOCK - 1) / 2))
    field = np.repeat(np.repeat(np.repeat(middle.reshape(blocks), BLOCK, 0), BLOCK, 1), BLOCK, 2).astype(np.float32)
    active = index[np.abs(middle) < cell * ((BLOCK - 1) / 2 * np.sqrt(3) + 1)]
    inner = np.stack(np.meshgrid(*(np.arange(BLOCK),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for some in np.array_split(active, max(1, len(active) * len(inner) // 2_000_000)):
        at = (BLOCK * some[:, None] + inner).reshape(-1, 3)
        field[tuple(at.T)] = distance(low + cell * at)
    field = -field[: shape[0], : shape[1], : shape[2]]
    solid = extract_region(Grid(low, cell, shape), np.ascontiguousarray(field, dtype=np.float64))
    if solid is None:
        raise StageError("no node of the voxel grid is inside: the solid is empty", "another cell, or method: implicit")
    return solid
