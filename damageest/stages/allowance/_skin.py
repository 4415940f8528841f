"""Finds the skin that a repair has to restore: the faces of a damage volume that lie on the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh, Part
from damageest.geometry.cutting import cut_triangles
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.edges import list_edges
from damageest.geometry.vectors import cross_corners
from damageest.stages.allowance._selectors import StockPlan

ON_PART = 1e-7
"""Distance from the part, in its diagonals, up to which a face lies on it."""


@dataclass(frozen=True, eq=False)
class SkinFaces:
    """Triangles of skin, with the stock to build on them.

    ``vertices``: (V,3) relative to the caller's origin. ``faces``: (F,3). ``parent``: (F,) the triangle of the part on
    which each face lies. ``normal``: (F,3) of that triangle, outward. ``height``: (F,) of the stock. ``free``: (F,)
    whether the face must have no stock.
    """

    vertices: Floats
    faces: Ints
    parent: Ints
    normal: Floats
    height: Floats
    free: NDArray[np.bool_]

    @property
    def triangles(self) -> Floats:
        """(F,3,3) corners."""
        return self.vertices[self.faces]

    @property
    def areas(self) -> Floats:
        """(F,) areas."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    def select(self, faces: NDArray[np.bool_]) -> SkinFaces:
        """The same skin with the faces (F,) that are selected."""
        return SkinFaces(
            self.vertices, self.faces[faces], self.parent[faces], self.normal[faces], self.height[faces],
            self.free[faces],
        )  # fmt: skip

    def find_border_edges(self) -> Ints:
        """(E,2) the edges of one face only."""
        edges = list_edges(self.faces)
        unique, count = np.unique(edges, axis=0, return_counts=True)
        return np.asarray(unique[count == 1])

    def sample(self, count: int, seed: int) -> tuple[Floats, Ints]:
        """``count`` random points (N,3), uniform by area, and the face (N,) of each."""
        rng = np.random.default_rng(seed)
        total = np.cumsum(self.areas)
        if not len(total) or not total[-1] > 0:
            return np.empty((0, 3)), np.empty(0, np.int64)
        face = np.minimum(np.searchsorted(total, rng.random(count) * total[-1], side="right"), len(total) - 1)
        u, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
        a, b, c = np.moveaxis(self.triangles[face], 1, 0)
        return np.asarray(a * (1 - u) + b * u * (1 - v) + c * u * v), face


def take_skin(body: Mesh, part: Part, plan: StockPlan, origin: Floats) -> SkinFaces:
    """The faces of a solid inside the part that lie on the part's surface, cut along the planes of the selectors, with
    the height of their stock. Relative to ``origin`` (3,)."""
    return label_skin(body.vertices - origin, body.faces, part, plan, origin)


def label_skin(vertices: Floats, faces: Ints, part: Part, plan: StockPlan, origin: Floats) -> SkinFaces:
    """As `take_skin`, of a mesh that is already relative to ``origin`` (3,)."""
    on, parent = find_on_part(vertices, faces, part, origin)
    faces, parent = faces[on], parent[on]
    for normal, offset in plan.planes(origin):
        value = vertices @ normal - offset
        value = np.where(np.abs(value) < ON_PART * part.diagonal, 0.0, value)
        vertices, faces, kept, _ = cut_triangles(vertices, faces, value)
        parent = parent[kept]
    normal = part.face_normals[parent]
    middle = vertices[faces].mean(axis=1) + origin
    height = plan.heights(middle, normal, parent, part)
    return SkinFaces(vertices, faces, parent, normal, height, plan.is_kept_free(middle, normal, parent, part))


def find_on_part(vertices: Floats, faces: Ints, part: Part, origin: Floats) -> tuple[NDArray[np.bool_], Ints]:
    """Whether each face (F,) lies on the part and faces the same way, and the part's triangle (F,) at its middle."""
    # points near the corners and in the middle, not the corners: a face of a cut may touch the skin along an edge
    weights = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6], [1 / 3, 1 / 3, 1 / 3]])
    corners = vertices[faces]
    probes = np.einsum("pk,fkj->fpj", weights, corners).reshape(-1, 3)
    distance, parent, _ = closest_on_mesh(probes + origin, part)
    near = distance.reshape(-1, 4).max(axis=1) <= ON_PART * part.diagonal
    parent = np.asarray(parent.reshape(-1, 4)[:, 3], np.int64)
    cross = cross_corners(corners)
    # the direction of a sliver is arbitrary, and gaps would remain without the slivers
    sliver = np.linalg.norm(cross, axis=1) < (100 * ON_PART * part.diagonal) ** 2
    return near & (sliver | (np.einsum("ij,ij->i", cross, part.cross[parent]) > 0)), parent
