"""The part's own skin, moved outward."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Mesh, Part, Solid, Surface
from damageest.stages.background import Background


class Offset(Background):
    """The part scaled up along its vertex normals and subdivided (paper 3.2): follows concave parts. It refuses parts
    whose gaps are narrower than twice the clearance."""

    use: Literal["offset"] = "offset"
    clearance: float = Field(
        2.0, gt=0, le=100, description="distance from the part, in tolerances; at least 1.5 point spacings"
    )
    edge: float = Field(
        3.0, gt=0, le=100, description="spacing of its vertices, in tolerances; more where that would make too many"
    )

    def run(self, part: Part, surface: Surface, tolerance: float, spacing: float) -> Solid:
        """Raises StageError where the moved skin does not hold the part."""
        from damageest.solids import to_manifold
        from damageest.stages.background._refine import check_holds, refined

        origin = part.bounds.mean(axis=0)
        by = max(self.clearance * tolerance, 1.5 * spacing)
        normals = part.cross / np.maximum(np.linalg.norm(part.cross, axis=1), 1e-300)[:, None]
        # Each vertex moves so that all planes through it move by the same: least squares over the distinct planes.
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
        skin = Mesh(part.vertices + by * move, part.faces)
        moved = refined(to_manifold(skin, origin), self.edge * max(tolerance, 0.5 * spacing), origin)
        return check_holds(moved, part, surface)
