"""Exact signed distance of each scan point to the triangles of the part (paper 3.1 step 4)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.distance_by_cells import signed_distance_by_cells
from damageest.stages.segment import Segment
from damageest.stages.segment._wear import find_wear

MIN_FOR_CELLS = 100_000
"""Number of scan points above which distances are computed by cells of a grid, not for each point."""


class MeshDistance(Segment):
    """Signed distance to the triangles of the part, exact, and a search for shallow wear."""

    use: Literal["mesh_distance"] = "mesh_distance"
    threshold: float = Field(
        1.0, gt=0, description="distance from the part beyond which a point is damage or added metal, in tolerances"
    )
    wear: bool = Field(
        True, description="also label shallower wear as damage, where the mean distance over neighbours shows it"
    )

    def run(self, aligned: Scan, part: Part, tolerance: float) -> Deviation:
        """Distance (N,), positive outside, in the job's unit; nearest triangle (N,); label (N,)."""
        limit = self.threshold * tolerance
        if len(aligned.points) > max(MIN_FOR_CELLS, 4 * len(part.faces)):
            points, near = aligned.points, 0.5 * min(limit, tolerance)
            distance, face = signed_distance_by_cells(points, part, near, lambda some: signed_distance(some, part))
        else:
            distance, face = signed_distance(aligned.points, part)
        label = np.full(len(distance), INTACT, np.uint8)
        label[distance < -limit] = DAMAGE
        label[distance > limit] = ADDED
        notes: tuple[str, ...] = ()
        if self.wear:
            found = find_wear(aligned, part, distance, face, limit)
            label[found.worn] = DAMAGE
            notes = found.notes
        return Deviation(distance=distance, face=face, label=label, notes=notes)
