"""The positive side of a field on a voxel grid, as a solid."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Ints, Solid
from damageest.geometry.poisson import Grid, GridValues

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
"""The corners of a cell in libigl's order."""


def extract_region(grid: Grid, field: GridValues) -> Solid | None:
    """The solid where a field is positive, closed by the walls of the grid; None where the field is nowhere positive.

    Args:
        grid: the places of the field's nodes; the solid is in its unit and frame.
        field: (shape of the grid) values of any unit at the nodes.

    By libigl's marching cubes. Values below 1e-5 of the largest count as positive. Raises ArtefactError where rounding
    leaves a mesh that is not watertight.
    """
    import igl

    scale = float(np.abs(field).max())
    if not scale > 0:
        return None
    # A zero level exactly at a node would give triangles without area, so values near zero are moved to one side.
    small = 1e-5 * scale
    values = np.pad(field, 1, constant_values=-scale)
    cells = _find_crossed_cells(values > -small)
    if not len(cells):
        return None
    # libigl is given these cells alone: on whole grids it takes several times as long.
    corners = cells[:, None] + CORNERS @ np.array([values.shape[1] * values.shape[2], values.shape[2], 1])
    is_used = np.zeros(values.size, bool)
    is_used[corners] = True
    used = np.flatnonzero(is_used)
    number = np.empty(values.size, np.int64)
    number[used] = np.arange(len(used))
    nodes = np.stack(np.unravel_index(used, values.shape), axis=1) - 1.0
    values = values.ravel()[used]
    values[np.abs(values) < small] = small
    found, faces, _ = igl.marching_cubes(values, nodes, number[corners], 0.0)
    if not len(faces):
        return None
    vertices = np.asarray(found) * grid.cell + grid.origin
    faces = np.asarray(faces, np.int64)
    corners = vertices[faces] - grid.origin
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        faces = faces[:, ::-1]
    return Solid(vertices, faces)


def _find_crossed_cells(inside: Flags) -> Ints:
    """The flat indices (C,) of the first corners of the cells that have corners both inside and outside."""
    some, every = inside, inside
    for axis in range(3):
        first, second = (slice(None),) * axis + (slice(-1),), (slice(None),) * axis + (slice(1, None),)
        some, every = some[first] | some[second], every[first] & every[second]
    crossed = np.zeros(inside.shape, bool)
    crossed[:-1, :-1, :-1] = some & ~every
    return np.flatnonzero(crossed)
