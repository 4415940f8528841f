"""Finds places without room for the stock: bores that it would close, walls that it would run into."""

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
"""Cosine between the normals of skin and wall below which the wall is opposite, and below which it is opposite even
where the two meet: a concave corner of less than 30 degrees."""
SAMPLES = 3000


@dataclass(frozen=True, eq=False)
class StockConflict:
    """Points of the skin where the stock has no room.

    ``points``: (N,3) in part coordinates. ``clearance``: (N,) free distance along the normal, to the opposite wall.
    ``height``: (N,) of the stock on this side. ``opposite``: (N,) height of the stock on the opposite wall.
    """

    points: Floats
    clearance: Floats
    height: Floats
    opposite: Floats

    def __str__(self) -> str:
        worst = int(np.argmin(self.clearance - self.height - self.opposite))
        x, y, z = self.points[worst]
        both = f" and {self.opposite[worst]:.4g} on the opposite wall" if self.opposite[worst] else ""
        return (
            f"no room for the stock at ({x:.4g}, {y:.4g}, {z:.4g}): {self.clearance[worst]:.4g} is free there, but "
            f"the stock is {self.height[worst]:.4g} high{both}"
        )

    def select(self, rows: NDArray[np.bool_]) -> StockConflict | None:
        """The places (N,) that are selected; None without any."""
        if not rows.any():
            return None
        return StockConflict(self.points[rows], self.clearance[rows], self.height[rows], self.opposite[rows])

    def touches(self, part: Part) -> NDArray[np.bool_]:
        """(N,) whether skin and wall touch there, as where a pin of an assembly sits in its bore. Each of them is known
        within the error of the triangles only, so what is free between them may be no gap; there is nothing to mill."""
        return np.asarray(self.clearance <= 2 * part.tessellation_error)


def place_probes(skin: SkinFaces, seed: int = 11) -> tuple[Floats, NDArray[np.int64]]:
    """Points (N,3) spread over the skin and in the middle of its triangles, and the face of each."""
    points, face = skin.sample(SAMPLES, seed)
    large = np.argsort(-skin.areas, kind="stable")[:SAMPLES]
    return np.concatenate([points, skin.triangles[large].mean(axis=1)]), np.concatenate([face, large])


def find_stock_conflict(skin: SkinFaces, part: Part, tolerance: float, origin: Floats) -> StockConflict | None:
    """Places where the stock meets an opposite wall of the part, or the stock on that wall; None where it has room.

    ``skin``: with the heights of its stock, relative to ``origin`` (3,).
    """
    tall = skin.select(skin.height > 0)
    if not len(tall.faces):
        return None
    points, face = place_probes(tall)
    normal, height = tall.normal[face], tall.height[face]
    most = float(height.max())
    away = 10 * ON_PART * part.diagonal
    body = to_manifold(part, origin)
    free, place, facing = _measure_clearance(body, points + away * normal, normal, height + most)
    hit = np.flatnonzero(np.isfinite(free))
    hit = hit[~_is_corner(points[hit], normal[hit], place[hit], facing[hit], part, tolerance, origin)]
    if not len(hit):
        return None
    distance, opposite, _ = closest_on_mesh(place[hit], Mesh(tall.vertices, tall.faces))
    other = np.where(distance <= away, tall.height[opposite], 0.0)
    short = free[hit] + away < height[hit] + other
    if not short.any():
        return None
    some = hit[short]
    return StockConflict(points[some] + origin, free[some] + away, height[some], other[short])


def _is_corner(
    points: Floats, normal: Floats, place: Floats, facing: Floats, part: Part, tolerance: float, origin: Floats
) -> NDArray[np.bool_]:
    """(N,) whether skin and wall belong to one concave corner.

    The planes of the two then meet on the part's surface. The planes of the flanks of a gap with a floor meet below the
    floor, inside the metal. ``points``, ``normal`` (N,3): of the skin; ``place``, ``facing`` (N,3): point and normal of
    the wall; points relative to ``origin`` (3,).
    """
    if not len(points):
        return np.zeros(0, bool)
    across = facing - np.einsum("ij,ij->i", facing, normal)[:, None] * normal
    steep = np.einsum("ij,ij->i", across, facing)
    wide = np.einsum("ij,ij->i", facing, normal) > NARROW
    steps = np.einsum("ij,ij->i", place - points, facing) / np.where(wide, steep, 1)
    meeting = points + np.where(wide, steps, 0)[:, None] * across
    return np.asarray(wide & (distance_to_mesh(meeting + origin, part) <= tolerance))


def _measure_clearance(body: Any, start: Floats, direction: Floats, reach: Floats) -> tuple[Floats, Floats, Floats]:
    """Casts a ray from each ``start`` (N,3) along its ``direction`` (N,3), up to ``reach`` (N,).

    Returns:
        The free distance (N,) to the first wall, inf where there is none within reach or it is not opposite; the place
        (N,3) on the wall; the wall's normal (N,3).
    """
    free, place, facing = np.full(len(start), np.inf), np.zeros((len(start), 3)), np.zeros((len(start), 3))
    for k, (a, d, far) in enumerate(zip(start, direction, reach, strict=True)):
        hits = body.ray_cast(tuple(a), tuple(a + far * d))
        if hits and np.dot(hits[0].normal, d) < OPPOSITE:
            free[k], place[k], facing[k] = hits[0].distance * far, hits[0].position, hits[0].normal
    return free, place, facing
