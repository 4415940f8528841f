"""Can the part as it is left have given this scan? A check of which side of an inner surface is lost.

It shares nothing with the stage that chose the side: it only asks, by rays, from where the inner surface could be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import INTACT, Flags, Floats, Ints, Reason, Solid
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours, pick_one_per_cube
from damageest.geometry.rays import RayCaster, prepare_rays
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import extract_ids, find_inner_faces
from damageest.geometry.vectors import spread_directions
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts

CONTRADICTED = 0.5
"""Share of the inner surface that could not have been seen. Right volumes have next to none, and what is left of a thin
wall, taken for what is lost, all of it."""
WAYS = 256
"""Directions in which it is looked, evenly over the sphere."""
PLACES = 150
"""Places of the inner surface, and of the intact skin beside it, that are asked, at most."""
FEWEST = 8
"""Places below which nothing is said."""
BESIDE = 4.0
"""How far from the site intact points are beside it, in point spacings or tolerances."""
OFF = 0.1
"""How far off the surface a ray begins, in tolerances."""
SEEN_BY = 0.05
"""Share of the intact places that can be seen in a direction, from which the scanner may have looked in it."""


class NotVisible(Rule):
    code = "not_visible"
    meaning = "the scanner could not have seen this inner surface: the other side may be lost"
    threshold = (
        f"{CONTRADICTED:.0%} of the inner surface is closed in, or faces away from where the skin beside it was seen"
    )
    remedy = "give the position of the scanner for each view, or scan the other side of the wall"
    topic = "unseen"
    rank = 140

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        visible = measure_visibility(case.damage, case.field, case.points)
        return {"shut": visible.shut, "turned": visible.turned}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        hidden = site.shut + site.turned
        if hidden <= CONTRADICTED:
            return
        how = (
            "lies in a closed cavity"
            if site.shut > site.turned
            else "faces away from where the skin beside it was seen"
        )
        text = f"{hidden:.0%} of its inner surface was invisible to the scanner: it {how}"
        yield Reason(self.code, text, "contradicts", remedy=self.remedy)


class Visibility(NamedTuple):
    """``shut``: share of the inner surface with scan points that could be seen from nowhere; ``turned``: that could be
    seen, but only from where none of the intact skin beside it could be."""

    shut: float = 0.0
    turned: float = 0.0


def measure_visibility(damage: Solid, field: ScanField, members: Floats) -> Visibility:
    """From where the inner surface below the points ``members`` (M,3) of a site can be seen, in the part without its
    damage volume, against from where the intact skin beside it was seen.

    Metal that other sites remove counts as there. Lengths are in the part's unit and frame.
    """
    if len(members) < FEWEST:
        return Visibility()
    part, tolerance = field.part, field.tolerance
    floor, is_inner = extract_ids(damage, part), find_inner_faces(damage, part)
    grain = max(tolerance, field.aligned.spacing)
    beside = _find_beside(field, members, BESIDE * grain)
    if not is_inner.any() or is_inner.all() or len(beside) < FEWEST:
        return Visibility()
    few = members[pick_one_per_cube(members, grain)]
    few = few[:: max(1, -(-len(few) // PLACES))]
    distance, face, foot = closest_on_mesh(few, floor)
    near = distance < grain
    if near.sum() < FEWEST:
        return Visibility()
    into, ways = floor.face_normals[face[near]], spread_directions(WAYS)
    from_skin = prepare_rays(part)
    skin = field.find_feet(beside) + OFF * tolerance * field.find_normals(beside)
    looked = _look_out(skin, ways, lambda start, way: ~_is_hit(from_skin, start, way)).mean(axis=0) > SEEN_BY
    body = RayCaster(damage)

    def escapes(start: Floats, way: Floats) -> Flags:
        length, hit = body.find_first(start, way)
        is_out = (hit < 0) | ~is_inner[hit]
        left = start + (np.where(np.isfinite(length), length, 0) + 2 * OFF * tolerance)[:, None] * way
        is_out[is_out] = ~_is_hit(from_skin, left[is_out], way[is_out])
        return is_out

    seen = _look_out(foot[near] + OFF * tolerance * into, ways, escapes)
    is_shut = ~seen.any(axis=1)
    return Visibility(float(is_shut.mean()), float((~is_shut & ~seen[:, looked].any(axis=1)).mean()))


def _find_beside(field: ScanField, members: Floats, reach: float) -> Ints:
    """Intact points near those of a site, evenly spread."""
    points, low, high = field.points, members.min(axis=0) - reach, members.max(axis=0) + reach
    index: Ints = find_in_box(points, low, high)
    index = index[field.label[index] == INTACT]
    if not len(index):
        return index
    index = index[np.isfinite(find_neighbours(points[index], 1, members, reach)[0][:, 0])]
    if not len(index):
        return index
    index = index[pick_one_per_cube(points[index], reach / BESIDE)]
    return index[:: max(1, -(-len(index) // PLACES))]


def _look_out(places: Floats, ways: Floats, escapes: Callable[[Floats, Floats], Flags]) -> Flags:
    """Whether each place (N,3) can be seen from each direction (D,3): (N,D)."""
    start = np.repeat(places, len(ways), axis=0)
    return np.asarray(escapes(start, np.tile(ways, (len(places), 1)))).reshape(len(places), len(ways))


def _is_hit(rays: RayCaster, start: Floats, way: Floats) -> Flags:
    return np.asarray(rays.find_first(start, way)[1] >= 0)
