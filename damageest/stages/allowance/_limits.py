"""Where there is no room for the stock: bores it would close, walls it would run into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh, Part
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.solids import to_manifold
from damageest.stages.allowance._skin import ON_PART, SkinFaces

OPPOSITE, NARROW = -0.5, -0.87
"""Cosine between the normals of skin and wall from which on the wall faces the skin, and from which on it does so even
where the two meet: a concave corner of 30 degrees."""
SAMPLES = 3000


@dataclass(frozen=True, eq=False)
class StockConflict:
    """Points of the skin whose stock has no room: ``points`` (N,3) relative to the origin, the ``free`` way (N,) along
    the normal to the opposite wall, the stock ``wanted`` (N,) on this side and on the ``other`` (N,)."""

    points: Floats
    clearance: Floats
    height: Floats
    opposite: Floats

    def __str__(self) -> str:
        worst = int(np.argmin(self.clearance - self.height - self.opposite))
        x, y, z = self.points[worst]
        both = f" and {self.opposite[worst]:.4g} on the opposite wall" if self.opposite[worst] else ""
        return (
            f"no room for the stock at ({x:.4g}, {y:.4g}, {z:.4g}): {self.clearance[worst]:.4g} is free there, and "
            f"{self.height[worst]:.4g} is wanted{both}"
        )


def place_probes(skin: SkinFaces, seed: int = 11) -> tuple[Floats, NDArray[np.int64]]:
    """Points (N,3) spread over the skin and in the middle of its triangles, and the face of each."""
    points, face = skin.sample(SAMPLES, seed)
    large = np.argsort(-skin.areas, kind="stable")[:SAMPLES]
    return np.concatenate([points, skin.triangles[large].mean(axis=1)]), np.concatenate([face, large])


def find_stock_conflict(skin: SkinFaces, part: Part, tolerance: float, origin: Floats) -> StockConflict | None:
    """Places where the stock meets an opposite wall of the part, or that wall's own stock; None where it has room.
    ``skin`` with what is wanted on it, relative to ``origin`` (3,)."""

    wanted = skin.select(skin.height > 0)
    if not len(wanted.faces):
        return None
    points, face = place_probes(wanted)
    normal, height = wanted.normal[face], wanted.height[face]
    most = float(height.max())
    away = 10 * ON_PART * part.diagonal
    body = to_manifold(part, origin)
    free, place, facing = _measure_clearance(body, points + away * normal, normal, height + most)
    hit = np.flatnonzero(np.isfinite(free))
    hit = hit[~_is_corner(points[hit], normal[hit], place[hit], facing[hit], part, tolerance, origin)]
    if not len(hit):
        return None
    distance, opposite, _ = closest_on_mesh(place[hit], Mesh(wanted.vertices, wanted.faces))
    other = np.where(distance <= away, wanted.height[opposite], 0.0)
    short = free[hit] + away < height[hit] + other
    if not short.any():
        return None
    some = hit[short]
    return StockConflict(points[some] + origin, free[some] + away, height[some], other[short])


def _is_corner(
    points: Floats, normal: Floats, place: Floats, facing: Floats, part: Part, tolerance: float, origin: Floats
) -> NDArray[np.bool_]:
    """(N,) whether skin and wall are those of one concave corner: their planes meet on the part's surface. Between the
    flanks of a gap with a floor they meet below it."""
    if not len(points):
        return np.zeros(0, bool)
    across = facing - np.einsum("ij,ij->i", facing, normal)[:, None] * normal
    steep = np.einsum("ij,ij->i", across, facing)
    wide = np.einsum("ij,ij->i", facing, normal) > NARROW
    steps = np.einsum("ij,ij->i", place - points, facing) / np.where(wide, steep, 1)
    meeting = points + np.where(wide, steps, 0)[:, None] * across
    return np.asarray(wide & (distance_to_mesh(meeting + origin, part) <= tolerance))


def _measure_clearance(body: Any, start: Floats, direction: Floats, reach: Floats) -> tuple[Floats, Floats, Floats]:
    """The free way (N,) from each start to the first wall that faces it, inf where that is beyond reach or the first
    wall does not face it; the place (N,3) where it ends, and the wall's normal (N,3)."""
    free, place, facing = np.full(len(start), np.inf), np.zeros((len(start), 3)), np.zeros((len(start), 3))
    for k, (a, d, far) in enumerate(zip(start, direction, reach, strict=True)):
        hits = body.ray_cast(tuple(a), tuple(a + far * d))
        if hits and np.dot(hits[0].normal, d) < OPPOSITE:
            free[k], place[k], facing[k] = hits[0].distance * far, hits[0].position, hits[0].normal
    return free, place, facing
