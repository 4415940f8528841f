"""The positive side of a field on a voxel grid, as a solid."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Solid
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
    values = np.where(np.abs(field) < 1e-5 * scale, 1e-5 * scale, field)
    values = np.pad(values, 1, constant_values=-scale)
    inside = values > 0
    first = inside[:-1, :-1, :-1]
    crossed = np.zeros(first.shape, bool)
    for x, y, z in CORNERS[1:]:
        crossed |= first != inside[x : x - 1 or None, y : y - 1 or None, z : z - 1 or None]
    cells = np.argwhere(crossed)
    if not len(cells):
        return None
    number = np.ravel_multi_index((cells[:, None] + CORNERS).reshape(-1, 3).T, values.shape)
    used, corners = np.unique(number, return_inverse=True)
    nodes = np.stack(np.unravel_index(used, values.shape), axis=1) - 1.0
    found, faces, _ = igl.marching_cubes(values.ravel()[used], nodes, corners.reshape(-1, 8), 0.0)
    if not len(faces):
        return None
    vertices = np.asarray(found) * grid.cell + grid.origin
    faces = np.asarray(faces, np.int64)
    corners = vertices[faces] - grid.origin
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        faces = faces[:, ::-1]
    return Solid(vertices, faces)
