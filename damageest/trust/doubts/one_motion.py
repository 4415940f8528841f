"""Whether one rigid motion brings the points of a site back onto the skin, as if a view of the scan were misplaced."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Reason
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.scan_field import ScanField
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.views.two_sheets import LEAST_NOISE

ALIKE = 1.5
"""Depth of another site, in depths of the one that a motion explains, up to which it is of the same view."""
LEAST_SHARE = 0.05
"""Share of the scan's points that a site has at least, for it to be what a view shows."""
ASKED, ROUNDS = 5000, 5
"""Points that are used, and rounds of the robust fit."""
OFF = 1.15
"""Deviation of the points from the skin after the motion, in noises, up to which it explains them."""
KEPT = 0.9
"""Share of the points that it has to explain."""
LEAST_ON_DATUM, SOUND = 100, 0.95
"""Points on the datums, and share of them within the tolerance, from which the datums hold the pose."""
SHARP = 30.0
"""Angle between triangles, in degrees, from which they belong to two faces of the part."""
OTHERS, AROUND = 0.06, 6
"""Share of the points on other faces than the one with most of them, of another direction, away from its edges: with so
many neighbours on the same face. One face that is worn evenly, and a journal that is worn on one side, are brought back
by a motion as well; two faces that are worn alike are hardly."""


class OneMotion(Rule):
    code = "one_motion"
    meaning = "one motion brings the site's points, on several faces, back onto the skin: a view is misplaced"
    threshold = (
        "the rest is noise, in nine tenths of its points; a site of 5% of the scan's points or more. Other "
        f"sites up to {ALIKE:g} times as deep may be of the same view"
    )
    remedy = "register the views again, or give them as a list of files"
    topic = "views"
    rank = 90

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        return {"one_motion": not case.is_held and is_one_motion(case.field, case.members)}

    def compare(self, site: SiteFacts, each: Sequence[SiteFacts], scan: ScanFacts) -> Mapping[str, Any]:
        return {"shifted": max((one.typical for one in each if one.one_motion), default=0.0)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.one_motion:
            text = (
                f"its {site.count} points, {site.typical:.3g} {scan.unit} deep, fit the skin after one "
                "motion: a misplaced view explains the site"
            )
            yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
        elif 0 < site.typical < ALIKE * site.shifted:
            text = (
                f"a misplaced view explains another site, {site.shifted:.3g} {scan.unit} deep, and may explain this one"
            )
            yield Reason(self.code, text, "contradicts", site.shifted, scan.unit, remedy=self.remedy)


def is_one_motion(field: ScanField, members: Ints) -> bool:
    """Whether one motion explains the points ``members`` (M,) of a site, over several faces of the part."""
    if len(members) < LEAST_SHARE * len(field.points) or len(members) < 100:
        return False
    some = members[:: max(1, len(members) // ASKED)]
    normals = field.find_normals(some)
    at = field.points[some] - field.points[some].mean(axis=0)
    rows = np.concatenate([np.cross(at / np.abs(at).max(), normals), normals], axis=1)
    distance, used = field.distance[some], np.ones(len(some), bool)
    scatter, left = np.inf, np.abs(distance)
    for _ in range(ROUNDS):
        motion = np.linalg.lstsq(rows[used], distance[used], rcond=None)[0]
        left = np.abs(distance - rows @ motion)
        scatter = 1.4826 * float(np.median(left))
        used = left <= 3 * scatter
    most = OFF * max(field.aligned.noise, LEAST_NOISE * field.tolerance)
    if scatter > most or float(used.mean()) < KEPT:
        return False
    face = _number_faces(field.part)[field.deviation.face[some]]
    around = face[find_neighbours(at, AROUND + 1, at)[1]]
    is_main = face == np.bincount(face).argmax()
    is_other = ~is_main & (around == face[:, None]).all(axis=1)
    is_other &= normals @ normals[is_main].mean(axis=0) < np.cos(np.radians(SHARP))
    return float(is_other.mean()) > OTHERS and 1.4826 * float(np.median(left[is_other])) < most


def are_sound(distance: Floats, on_datums: Flags, tolerance: float) -> bool:
    """Whether datums hold the pose: their points (N,), of all, lie on the part. A motion that all other skin has in
    common is then what it has lost. ``distance`` (N,): of all points."""
    own = np.abs(distance[on_datums])
    return len(own) >= LEAST_ON_DATUM and float((own <= tolerance).mean()) >= SOUND


def _number_faces(part: Part) -> Ints:
    """(F,) the number of the smooth face that each triangle belongs to."""
    import trimesh
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs = trimesh.graph.face_adjacency(part.faces)
    first, second = pairs.T
    cosine = np.einsum("ij,ij->i", part.face_normals[first], part.face_normals[second])
    first, second = pairs[cosine > np.cos(np.radians(SHARP))].T
    links = coo_matrix((np.ones(len(first), bool), (first, second)), shape=(len(part.faces),) * 2)
    return np.asarray(connected_components(links, directed=False)[1])
