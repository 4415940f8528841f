"""Whether a volume, lost or added, holds more or less than the scan points on its surface show.

Two things bound it. It is not larger than the skin under it times the distance of its points from that skin. And
between its points its surface does not leave them: a bulge lies behind all points near it. An undercut is larger than
the first says, and its points show it, so that the first counts only where part of the surface has no points. Where a
surface lies before most points near it, the volume is too small: a wall thinner than the tolerance comes out thick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Solid, Vector
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.edges import pair_faces
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces, take_lost_skin
from damageest.geometry.vectors import to_vector

ASKED, CONTRADICTED = 0.01, 0.03
"""Share of the volume that no point shows, above which it is reported, and above which it contradicts the volume.
Measured with points 2.5 to 5 tolerances apart: true volumes (pits, an edge, a narrow hole, a worn bore, a pocket half a
gap deep) have at most 0.007; a pocket found 27 % too large has 0.035. What is too large beside the rim does not show
here: a pocket found 13 % too large, mostly beside its rim, has 0.005."""
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
    does not matter. ``depth``: of the farthest point from the skin. ``short``: volume that the points show, and that it
    does not hold. ``at``: the place (3,) that lies farthest behind its points, in the part's frame; None where it is
    not between points that the volume is too large.
    """

    amount: float = 0.0
    share: float = 0.0
    depth: float = 0.0
    reason: str = ""
    short: float = 0.0
    at: Vector | None = None

    @property
    def is_contradicted(self) -> bool:
        """Whether the share is so large that the volume is wrong."""
        return self.share > CONTRADICTED


def measure_beyond_points(solid: Solid, field: ScanField, own: Floats, unit: str) -> BeyondPoints:
    """How much of a volume its scan points do not show.

    Args:
        solid: a damage volume, or added metal, one piece or more.
        own: (M,3) the scan points on it, in the part's frame. field: that of the whole scan, in the job's ``unit``.
    """
    noise, gap, tolerance = field.aligned.noise, field.aligned.spacing, field.tolerance
    inner = find_inner_faces(solid, field.part)
    if not len(own) or inner.all() or not inner.any():
        return BeyondPoints()
    volume = solid.volume
    area = solid.face_areas
    skin = take_lost_skin(solid, inner)
    depth = float(distance_to_mesh(own[:: max(1, len(own) // MOST)], skin).max())
    places, behind, before, bare = _compare_with_points(
        solid, inner, field.points, 2 * max(gap, tolerance), BARE * max(gap, tolerance)
    )
    slack = NOISES * noise + GAPS * gap
    each = float(area[inner].sum()) / len(behind)
    bulge = each * float(np.maximum(behind - slack, 0).sum())
    short = each * float(before[before > slack].sum())
    deepest = depth + slack
    most = float(area[~inner].sum()) * deepest + _measure_hollow(solid, ~inner) * deepest**2 / 2
    is_shown = bare <= SEEN and bulge <= STRAY * volume
    over = 0.0 if is_shown else volume - most
    amount = max(bulge, over, 0.0)
    share = amount / max(volume, 1e-300)
    reason, at = "", None
    if share > ASKED and over >= bulge:
        reason = (
            f"its volume of {volume:.4g} {unit}³ exceeds lost skin times depth ({most:.4g} {unit}³): its surface "
            "bulges without scan points"
        )
    elif share > ASKED:
        x, y, z = at = to_vector(places[behind.argmax()])
        reason = (
            f"its surface bulges by {amount:.3g} {unit}³ ({share:.1%}), up to {behind.max():.3g} {unit} near "
            f"({x:.4g}, {y:.4g}, {z:.4g}), between points that are {gap:.3g} {unit} apart"
        )
    return BeyondPoints(amount, share, depth, reason, short, at)


def _compare_with_points(
    solid: Solid, inner: Flags, points: Floats, wide: float, far: float
) -> tuple[Floats, Floats, Floats, float]:
    """Places (P,3) all over the inner faces; how far each (P,) lies behind all scan points near it, as the volume
    sees it, and how far before most of them; and the share of the places that have no point within ``far``. Farther
    than ``wide``, none is near."""
    places, face = sample_by_area(solid, PLACES, np.random.default_rng(0), np.flatnonzero(inner))
    points = points[find_in_box(points, places.min(axis=0) - wide, places.max(axis=0) + wide)]
    if not len(points):
        return places, np.zeros(len(places)), np.zeros(len(places)), 1.0
    distance, index = find_neighbours(places, NEAR, points)
    height = np.einsum("ikj,ij->ik", places[:, None] - points[index], solid.face_normals[face])
    is_near = distance <= wide
    lowest = np.where(is_near, height, np.inf).min(axis=1)
    before = np.where(is_near.all(axis=1), -np.median(height, axis=1), 0.0)
    return places, np.where(is_near[:, 0], lowest, 0.0), before, float((distance[:, 0] > far).mean())


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
