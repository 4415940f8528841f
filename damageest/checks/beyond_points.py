"""Whether a volume, lost or added, holds more than the scan points on its surface show.

Two things bound it. It is not larger than the skin under it times the distance of its points from that skin. And
between its points its surface does not leave them: a bulge lies behind all points near it. An undercut is larger than
the first says, and its points show it, so that the first counts only where part of the surface has no points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh, Part, Solid
from damageest.checks.inner_surface import pair_faces
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin import find_inner_faces
from damageest.rules.beyond_points import ASKED, CONTRADICTED

PLACES, MOST = 4000, 20_000
"""Places on the surface, and points of the site, that are looked at."""
NEAR = 3
"""Scan points near a place that all lie before it where the surface bulges. With one or two, the upright wall of a
shallow pocket, which lies between points, counts too."""
NOISES, GAPS = 3.0, 0.05
"""How far a place may lie behind them: in noises, and in gaps between the points."""
BARE = 1.6
"""Distance of a place from the nearest scan point, in gaps, from which the scan does not show it."""
SEEN, STRAY = 0.05, 0.01
"""Share of the surface without points, and share of the volume behind points, up to which the points show all of the
surface, as that of an undercut."""


@dataclass(frozen=True)
class BeyondPoints:
    """``amount``: volume that no scan point shows; ``share`` of the whole. ``reason`` in words, empty for a share that
    does not matter. ``depth``: of the farthest point from the skin."""

    amount: float
    share: float
    depth: float
    reason: str

    @property
    def is_contradicted(self) -> bool:
        """Whether the share is so large that the volume is wrong."""
        return self.share > CONTRADICTED


def ask_beyond_points(
    solid: Solid, part: Part, own: Floats, points: Floats, noise: float, gap: float, tolerance: float, unit: str
) -> BeyondPoints:
    """How much of a volume its scan points do not show.

    Args:
        solid: a damage volume, or added metal, one piece or more.
        own: (M,3) the scan points on it; points: (N,3) the whole scan; both in the part's frame.
        gap: the spacing of the scan. noise, gap and tolerance are in the job's ``unit``.
    """
    inner = find_inner_faces(solid, part)
    if not len(own) or inner.all() or not inner.any():
        return BeyondPoints(0.0, 0.0, 0.0, "")
    volume = solid.volume
    area = np.linalg.norm(solid.cross, axis=1) / 2
    skin = Mesh(solid.vertices, solid.faces[~inner])
    depth = float(distance_to_mesh(own[:: max(1, len(own) // MOST)], skin).max())
    behind, bare = _measure_behind(solid, inner, points, 2 * max(gap, tolerance), BARE * max(gap, tolerance))
    bulge = float(area[inner].sum() / len(behind) * np.maximum(behind - NOISES * noise - GAPS * gap, 0).sum())
    deepest = depth + NOISES * noise + GAPS * gap
    most = float(area[~inner].sum()) * deepest + _measure_hollow(solid, ~inner) * deepest**2 / 2
    is_shown = bare <= SEEN and bulge <= STRAY * volume
    over = 0.0 if is_shown else volume - most
    amount = max(bulge, over, 0.0)
    share = amount / max(volume, 1e-300)
    reason = ""
    if share > ASKED and over >= bulge:
        reason = (
            f"its volume of {volume:.4g} {unit}³ is more than the skin under it times the depth of its scan points "
            f"allows ({most:.4g}): its surface bulges where it has no scan points"
        )
    elif share > ASKED:
        reason = (
            f"{amount:.3g} {unit}³ of it ({share:.1%}) lie behind the scan points near them, up to "
            f"{behind.max():.3g} {unit}: its surface bulges between the points, which are {gap:.3g} {unit} apart"
        )
    return BeyondPoints(amount, share, depth, reason)


def _measure_behind(solid: Solid, inner: Flags, points: Floats, wide: float, far: float) -> tuple[Floats, float]:
    """How far places (P,) all over the inner faces lie behind all scan points near them, seen from the volume; and the
    share of the places that have no point within ``far``. Farther than ``wide``, none is near."""
    places, face = sample_by_area(solid, PLACES, np.random.default_rng(0), np.flatnonzero(inner))
    points = points[find_in_box(points, places.min(axis=0) - wide, places.max(axis=0) + wide)]
    if not len(points):
        return np.zeros(len(places)), 1.0
    distance, index = find_neighbours(places, NEAR, points)
    outward = solid.face_normals[face]
    height = np.einsum("ikj,ij->ik", places[:, None] - points[index], outward)
    height[distance > wide] = np.inf
    behind = np.where(np.isfinite(height[:, 0]), height.min(axis=1), 0.0)
    return behind, float((distance[:, 0] > far).mean())


def _measure_hollow(solid: Solid, skin: Flags) -> float:
    """Length times angle by which the skin is hollow, as a bore is: the volume under it is larger than under a flat one
    by half of that times the square of the depth."""
    starts, ends, first, second = pair_faces(solid.faces)
    within = skin[first] & skin[second]
    along = (solid.vertices[ends] - solid.vertices[starts])[within]
    length = np.linalg.norm(along, axis=1)
    a, b = solid.face_normals[first[within]], solid.face_normals[second[within]]
    sine = np.einsum("ij,ij->i", np.cross(a, b), along) / np.maximum(length, 1e-300)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", a, b))
    return float(length @ np.maximum(-angle, 0))
