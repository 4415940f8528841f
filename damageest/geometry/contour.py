"""The solid inside a distance function's zero level, sampled on a voxel grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Ints, Solid
from damageest.errors import StageError
from damageest.geometry.isosurface import extract_region
from damageest.geometry.poisson import Grid
from damageest.geometry.refinement import bisect_faces
from damageest.isolation.memory import require_memory

Measure = Callable[[Floats], Floats]
Nearest = Callable[[Floats], tuple[Floats, Floats]]
Matters = Callable[[Floats, float], Flags]
Shape = tuple[int, int, int]
BLOCK = 8
"""Nodes along each axis of the blocks in which the function is first evaluated once; a power of 2."""
FIT_ROUNDS = 8
"""How often faces are halved that are not where they should be."""
AT_ONCE = 2_000_000
"""Largest number of points for which the function is called."""
MOST_NODES = 60_000_000
"""Nodes of a grid in memory at once, at about 12 bytes each."""
BYTES_OF_NODE = 20
"""Memory of a grid, for each node."""


def extract_contour(
    distance: Measure,
    low: Floats,
    shape: Shape,
    cell: float,
    matters: Matters | None = None,
) -> Solid:
    """The solid where ``distance`` is negative, by marching cubes on a voxel grid; the walls of the grid close it.

    Args:
        distance: takes points (N,3) and gives signed values (N,) that change by no more than the points move
            (Lipschitz constant 1), as a signed distance does. It is called with many points at once.
        low: (3,) the grid's lowest node.
        shape: how many nodes the grid has along x, y and z.
        cell: the grid spacing.
        matters: whether the surface is of interest anywhere within a distance of points (N,3); elsewhere it is not
            exact. None: everywhere.

    ``low``, ``cell`` and the values are lengths in one unit, ``low`` in the frame of the points; so is the solid. The
    function is evaluated once per block of nodes, and in the eighths of a block only where the zero level may cross it.

    Raises StageError where the grid would not fit in memory (see MOST_NODES), or where no node is inside.
    """
    if (nodes := int(np.prod(shape))) > MOST_NODES:
        raise StageError(
            f"a voxel grid of {nodes:,} nodes, {cell:.3g} apart, does not fit in memory; at most {MOST_NODES:,} do",
            f"a cell of {cell * (nodes / MOST_NODES) ** (1 / 3) * 1.05:.3g} or more",
            method="implicit",
        )
    require_memory(BYTES_OF_NODE * nodes, f"a voxel grid of {nodes:,} nodes, {cell:.3g} apart", "a larger tolerance")
    field = -_sample(distance, low, shape, cell, matters)
    solid = extract_region(Grid(low, cell, shape), np.ascontiguousarray(field, dtype=np.float64))
    if solid is None:
        raise StageError("no node of the voxel grid is inside: the solid is empty", "another cell", method="implicit")
    return solid


def _sample(distance: Measure, low: Floats, shape: Shape, cell: float, matters: Matters | None) -> NDArray[np.float32]:
    """The distance at the nodes of a grid, exact where it is below one cell; elsewhere it is larger than that, and has
    the right sign."""
    sizes = [-(-n // BLOCK) * BLOCK for n in shape]
    field = np.empty(sizes, np.float32)
    blocks, size = _list_nodes([n // BLOCK for n in sizes]), BLOCK
    while True:
        middle = low + cell * (size * blocks + (size - 1) / 2)
        values = _evaluate(distance, middle)
        x, y, z = blocks.T
        split = (sizes[0] // size, size, sizes[1] // size, size, sizes[2] // size, size)
        field.reshape(split)[x, :, y, :, z, :] = values[:, None, None, None]
        if size == 1:
            return field[: shape[0], : shape[1], : shape[2]]
        reach = cell * ((size - 1) / 2 * np.sqrt(3) + 1)
        active = np.flatnonzero(np.abs(values) < reach)
        if matters is not None and size > 2:
            active = active[matters(middle[active], reach)]
        blocks, size = (2 * blocks[active][:, None] + _list_nodes((2, 2, 2))).reshape(-1, 3), size // 2


def fit_contour(solid: Solid, closest: Nearest, reach: float, error: float, matters: Matters) -> Solid:
    """The solid with its surface moved to a distance ``reach`` from a mesh, where it is near that.

    Args:
        solid: as `extract_contour` gives it, for that distance minus ``reach``.
        closest: takes points (N,3) and gives their distances (N,) to the mesh, and the nearest places (N,3) on it.
        error: where the middle of a face is farther from there than this, the face is divided.
        matters: as of `extract_contour`; other faces stay as they are.

    All are lengths in one unit. After `FIT_ROUNDS` rounds the creases of the surface are as good as they get.
    """
    vertices, faces = np.array(solid.vertices), np.array(solid.faces)
    longest = float(np.linalg.norm(vertices[faces[:, 1]] - vertices[faces[:, 0]], axis=1).max(initial=0))

    def pull(points: Floats) -> Floats:
        points = points.copy()
        some = np.flatnonzero(matters(points, longest)) if len(points) else np.zeros(0, np.int64)
        for _ in range(2):
            distance, place = closest(points[some])
            step = (distance - reach) / np.maximum(distance, 1e-300)
            points[some] -= np.clip(step, -0.5, 0.5)[:, None] * (points[some] - place)
            some = some[np.abs(distance - reach) > error]
        return points

    vertices = pull(vertices)
    fresh = np.ones(len(faces), bool)
    for _ in range(FIT_ROUNDS):
        index = np.flatnonzero(fresh)
        middle = vertices[faces[index]].mean(axis=1)
        off = np.abs(closest(middle)[0] - reach) > error
        off[off] = matters(middle[off], 0.0)
        if not off.any():
            break
        count = len(vertices)
        vertices, divided, parent = bisect_faces(vertices, faces, index[off])
        vertices[count:] = pull(vertices[count:])
        fresh = np.bincount(parent, minlength=len(faces))[parent] > 1
        faces = divided
    return Solid(vertices, faces)


def _list_nodes(shape: Sequence[int]) -> Ints:
    return np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)


def _evaluate(distance: Measure, points: Floats) -> Floats:
    if not len(points):
        return np.empty(0)
    return np.concatenate([distance(some) for some in np.array_split(points, -(-len(points) // AT_ONCE))])
