"""Samples on faces, and exactly on sharp edges and corners (paper 3.1 step 1)."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Mesh, Part, Samples
from damageest.errors import InputError
from damageest.geometry.spreading import spread_on_faces
from damageest.io.digests import digest
from damageest.io.part_store import Arrays, recall
from damageest.stages.sample import Sample
from damageest.stages.sample._edges import place_sharp_points

COSTLY = 50_000
"""Triangles from which on the points of a part are kept for later runs with the same part and tolerance."""


class EdgeAware(Sample):
    """Points on the faces, and points exactly on sharp edges and corners; no random draws."""

    use: Literal["edge_aware"] = "edge_aware"
    spacing: float = Field(
        1.0, gt=0, description="largest distance from any place of the surface to the nearest point, in tolerances"
    )
    angle: float = Field(
        30.0,
        gt=0,
        lt=180,
        description="an edge is sharp where the normals of its faces differ by more than this, in degrees",
    )
    max_points: int = Field(
        400_000,
        ge=1000,
        description="largest number of points; where the spacing would need more, the spacing is enlarged",
    )

    def run(self, part: Part, tolerance: float) -> Samples:
        """Points (N,3) in the part's frame; every point of the surface is within ``Samples.spacing`` of one of them.

        Raises InputError where the part has no area.
        """
        if not part.area > 0:
            raise InputError("the part's surface has no area; check the file it was read from")
        if len(part.faces) < COSTLY:
            return self._place(part, tolerance)
        key = digest(part.vertices, part.faces, tolerance, self.spacing, self.angle, self.max_points)
        kept = recall("samples", key, lambda: _pack(self._place(part, tolerance)))
        return Samples(**{**kept, "spacing": float(kept["spacing"])})  # type: ignore[arg-type]

    def _place(self, part: Part, tolerance: float) -> Samples:
        area = part.area
        # one grid per triangle needs at least a quarter more points than one grid over all
        spacing = max(self.spacing * tolerance, float(np.sqrt(1.25 * area / self.max_points)))
        while True:
            samples = _sample(part, spacing, self.angle)
            excess = len(samples.points) / self.max_points
            if excess <= 1:
                return samples
            spacing *= 1.04 * np.sqrt(excess)


def _pack(samples: Samples) -> Arrays:
    return {field.name: np.asarray(getattr(samples, field.name)) for field in dataclasses.fields(samples)}


def _sample(part: Mesh, spacing: float, angle: float) -> Samples:
    points, face = spread_on_faces(part, spacing)
    edge_points, edge_normals, edge_face, edge_kind = place_sharp_points(part, spacing, angle)
    return Samples(
        points=np.concatenate([points, edge_points]),
        normals=np.concatenate([part.face_normals[face], edge_normals]),
        face=np.concatenate([face, edge_face]),
        kind=np.concatenate([np.zeros(len(face), np.uint8), edge_kind]),
        spacing=spacing,
    )
