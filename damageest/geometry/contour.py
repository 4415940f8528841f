"""The surface at a given distance from a part, on a regular lattice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.errors import StageError
from damageest.geometry.isosurface import extract_region
from damageest.geometry.poisson import Grid

BLOCK = 6
MOST_NODES = 60_000_000
"""Nodes of a lattice in memory at once, at some 12 bytes each."""


def extract_contour(
    distance: Callable[[Floats], Floats], low: Floats, shape: tuple[int, int, int], cell: float
) -> Solid:
    """Where ``distance`` (points (N,3) to signed values (N,), Lipschitz with constant 1) is negative, as a solid, on
    the lattice of ``shape`` nodes from ``low`` (3,) on, ``cell`` apart; the lattice's walls close it.

    Exact values are only taken in blocks of nodes that the zero level may cross. Raises StageError where the lattice
    would not fit in memory, or nothing lies inside.
    """
    if (nodes := int(np.prod(shape))) > MOST_NODES:
        raise StageError(
            f"a lattice of {nodes:,} nodes {cell:.3g} apart is too large; {MOST_NODES:,} are bearable",
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
        raise StageError("the background came out empty", "another cell, or method: implicit")
    return solid
