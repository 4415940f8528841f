"""Triangles cut into short pieces, so that a tree of their boxes is fast.

A tree of boxes is slow where boxes of long triangles, as flat faces of CAD models are cut into, cover those of many
others. Measured with libigl's tree: a third of the time on damage volumes, half on parts of flat faces, a fifth more on
a bare cylinder.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.vectors import cross_corners, measure_longest_edges

Tree = tuple[Any, Floats, Ints, Ints]
"""libigl's tree of boxes, vertices (V,3) and the pieces (P,3) that it holds, and the triangle (P,) of each piece."""
SHORT = 0.1
"""Longest edge of a piece, in diagonals of the mesh's bounds."""
LOOSE = 3.0
"""Area of half the sides of all boxes, in areas of the triangles, below which boxes are tight, as those of a cylinder's
slivers along its axis: smaller ones would only be more."""
MOST_MORE = 100_000
"""Pieces that may be added; beyond that, and beyond one for each triangle, pieces are longer."""


def cut_long_faces(vertices: Floats, faces: Ints) -> tuple[Floats, Ints, Ints]:
    """The triangles (F,3) with those that are long halved at their longest edge, until all are short.

    Gives vertices (V,3), those of the mesh first, pieces (P,3) that cover the same surface, and the triangle (P,) that
    each is a piece of. Neighbours do not share vertices everywhere: for distances only.
    """
    numbers = np.arange(len(faces))
    if not len(faces):
        return vertices, faces, numbers
    edge, corners = SHORT * float(np.linalg.norm(np.ptp(vertices, axis=0))), np.take(vertices, faces, axis=0)
    longest = measure_longest_edges(corners)
    if longest.max() <= edge or _measure_looseness(corners) < LOOSE:
        return vertices, faces, numbers
    while edge and np.sum(longest[longest > edge] / edge) > max(MOST_MORE, len(faces)):
        edge *= 2
    done: list[tuple[Ints, Ints]] = []
    is_long = longest > edge
    while is_long.any():
        done.append((faces[~is_long], numbers[~is_long]))
        vertices, faces = _halve(vertices, faces[is_long])
        numbers = np.tile(numbers[is_long], 2)
        is_long = measure_longest_edges(vertices[faces]) > edge
    done.append((faces, numbers))
    faces, numbers = (np.concatenate(column) for column in zip(*done, strict=True))
    return vertices, faces, numbers


def build_tree(vertices: Floats, faces: Ints) -> Tree:
    """libigl's tree of boxes over short pieces of triangles (F,3), and these as `cut_long_faces` gives them."""
    import igl

    pieces = cut_long_faces(vertices, faces)
    tree = igl.AABB()
    tree.init(*pieces[:2])
    return tree, *pieces


def _measure_looseness(corners: Floats) -> float:
    """The area of half the sides of the boxes about triangles (F,3,3), in areas of the triangles."""
    x, y, z = (
        np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c) for a, b, c in corners.transpose(2, 1, 0)
    )
    cross = cross_corners(corners)
    return float((x * y + y * z + z * x).sum() / max(float(np.linalg.norm(cross, axis=1).sum() / 2), 1e-300))


def _halve(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The triangles (F,3) halved at their longest edge, (2F,3), and the vertices with the middles of these edges."""
    corners = vertices[faces]
    first = ((np.roll(corners, -1, axis=1) - corners) ** 2).sum(axis=2).argmax(axis=1)
    rows, middle = np.arange(len(faces)), len(vertices) + np.arange(len(faces))
    a, b, c = (faces[rows, (first + k) % 3] for k in range(3))
    vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
    return vertices, np.concatenate([np.column_stack([a, middle, c]), np.column_stack([middle, b, c])])
