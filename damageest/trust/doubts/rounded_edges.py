"""The site runs along nearly all sharp edges that the scan shows: they are rounded everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Part, Reason, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.edges import pair_faces
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.sampling import place_along, sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces, take_lost_skin
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts

SHARP = 40.0
"""Angle of a convex edge, in degrees, from which it is sharp."""
ALL = 0.6
"""Share of the length of all sharp edges that the scan shows, from which the site runs along nearly all. A block whose
scan was smoothed until its edges were round has 0.8."""
BESIDE = 0.5
"""Median distance of the inner surface from the nearest sharp edge, in that of all skin, up to which it lies along
edges; 0.2 on that block. Where a part is worn all over it is 1."""
WIDE = 0.5
"""Diagonal of the site, in that of the part, below which it runs along a few edges at most."""
STEPS, PLACES = 200, 2000
"""Places on edges along the part's diagonal, and places on the skin."""
ON = 0.05
"""Distance from the lost skin, in tolerances, up to which a place is on it."""
ALIKE = 1.5
"""Depth of another site, in depths of the one along the edges, up to which the same explains it."""
SHOWN, HALF = 3.0, 0.5
"""Distance of a scan point, in spacings or tolerances, up to which an edge is shown; and the share of all sharp edges
that the scan shows at least, for it to tell: the one cutting edge that a scan shows may well be worn."""


class RoundedEdges(Rule):
    code = "rounded_edges"
    meaning = "the site runs along nearly all sharp edges: the scan was smoothed, or the part's edges are broken"
    threshold = (
        f"{ALL:.0%} of the sharp edges that the scan shows, half of them at least, and no other skin. Other "
        f"sites up to {ALIKE:g} times as deep may have the same cause"
    )
    remedy = "scan without smoothing; or draw the broken edges into the CAD part"
    topic = "wear"
    rank = 165

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        return {"edges": measure_edges(case.damage, case.field)}

    def compare(self, site: SiteFacts, each: Sequence[SiteFacts], scan: ScanFacts) -> Mapping[str, Any]:
        return {"rounded": max((one.typical for one in each if one.edges > ALL), default=0.0)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.edges > ALL:
            text = (
                f"it runs along {site.edges:.0%} of all sharp edges: a scan that was smoothed, or edges that were "
                "broken on purpose, explain it"
            )
            yield Reason(self.code, text, "contradicts", site.volume, f"{scan.unit}³", remedy=self.remedy)
        elif 0 < site.typical < ALIKE * site.rounded:
            text = (
                f"nearly all sharp edges are rounded, {site.rounded:.3g} {scan.unit} deep: a scan that was smoothed "
                "may explain this site"
            )
            yield Reason(self.code, text, "contradicts", site.rounded, scan.unit, remedy=self.remedy)


def measure_edges(damage: Solid, field: ScanField) -> float:
    """The share of the length of the part's sharp convex edges, of those that the scan shows, along which a loss runs;
    0 for one that takes other skin."""
    part = field.part
    if np.linalg.norm(np.ptp(damage.bounds, axis=0)) < WIDE * part.diagonal:
        return 0.0
    inner = find_inner_faces(damage, part)
    places = _place_on_edges(part)
    if not len(places) or not inner.any() or inner.all():
        return 0.0
    rng = np.random.default_rng(0)
    # not the lost skin: a volume can have flakes on intact skin, as thin as rounding
    floor, _ = sample_by_area(damage, PLACES, rng, np.flatnonzero(inner))
    skin, _ = sample_by_area(part, PLACES, rng)
    away, usual = (float(np.median(find_neighbours(some, 1, places)[0])) for some in (floor, skin))
    if away > BESIDE * usual:
        return 0.0
    shown = places[_is_shown(places, field)]
    if len(shown) < HALF * len(places):
        return 0.0
    return float((distance_to_mesh(shown, take_lost_skin(damage, inner)) < ON * field.tolerance).mean())


def _place_on_edges(part: Part) -> Floats:
    """Places (N,3) along the sharp convex edges."""
    starts, ends, one, other = pair_faces(part.faces)
    first, second = part.face_normals[one], part.face_normals[other]
    is_sharp = np.einsum("ij,ij->i", first, second) < np.cos(np.radians(SHARP))
    way = part.vertices[ends] - part.vertices[starts]
    is_sharp &= np.einsum("ij,ij->i", np.cross(first, second), way) > 0
    edges = np.stack([starts, ends], axis=1)[is_sharp]
    return place_along(part.vertices, edges, part.diagonal / STEPS)


def _is_shown(places: Floats, field: ScanField) -> Flags:
    """Which of the places (N,3) have a scan point near."""
    reach = SHOWN * max(field.aligned.spacing, field.tolerance)
    return np.asarray(np.isfinite(find_neighbours(places, 1, field.points, reach)[0][:, 0]))
