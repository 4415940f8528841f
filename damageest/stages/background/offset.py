"""The part's own skin, moved outward, as background."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Surface
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import to_manifold, to_solid
from damageest.stages.background._level_set import build_level_set
from damageest.stages.background._shape import ShapeBackground, find_outside, list_skin


class Offset(ShapeBackground):
    """The part's skin moved outward along its vertex normals (paper 3.2). Follows concave parts exactly.

    Where it would not hold the part, as in gaps narrower than twice the clearance and at vertices where opposite faces
    meet, it is the surface at the clearance, that of `minkowski`.
    """

    use: Literal["offset"] = "offset"

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The part with its vertices moved outward."""
        normals = part.face_normals
        # Each vertex moves so that all planes through it move by the same amount: least squares over distinct planes.
        pairs = np.stack([part.faces.ravel(), np.repeat(np.arange(len(part.faces)), 3)], axis=1)
        key = np.concatenate([pairs[:, :1], np.round(normals[pairs[:, 1]], 3)], axis=1)
        chosen = pairs[np.unique(key, axis=0, return_index=True)[1]]
        n = normals[chosen[:, 1]]
        left = np.zeros((len(part.vertices), 3, 3))
        right = np.zeros((len(part.vertices), 3))
        np.add.at(left, chosen[:, 0], n[:, :, None] * n[:, None, :])
        np.add.at(right, chosen[:, 0], n)
        move = np.linalg.solve(left + 1e-3 * np.eye(3), right[:, :, None])[:, :, 0]
        move *= np.minimum(1, 3 / np.maximum(np.linalg.norm(move, axis=1), 1e-12))[:, None]
        moved = to_manifold(Mesh(part.vertices + gap * move, part.faces), origin)
        return moved if _is_round(moved, part, surface, gap, origin) else build_level_set(part, gap, origin)


def _is_round(moved: Any, part: Part, surface: Surface, gap: float, origin: Floats) -> bool:
    """Whether the moved skin holds the part, and what of the damage surface is nearer to it than the ``gap``."""
    solid = to_solid(moved, origin)
    if solid is None:
        return False
    outside = find_outside(solid, list_skin(part), surface)
    return not len(outside) or not bool((np.abs(signed_distance(outside, part)[0]) < gap).any())
