"""A small site for trying rules and terms without a run: a corner of a box that is lost, and a scan of what is left."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from damageest.artefacts import DAMAGE, INTACT, Evidence, Part, Pose, Scan
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces
from damageest.trust.beyond_points import BeyondPoints
from damageest.trust.doubt import ScanFacts, SiteCase, SiteFacts
from damageest.trust.interval.loss import Loss, LossCase, ScanErrors
from damageest.trust.interval.pose_error import measure_pose_error
from damageest.trust.interval.scanner import ScannerErrors
from damageest.trust.skin.coverage import SkinView, measure_coverage
from damageest.trust.skin.skin_cells import cut_skin, find_seen

SIZE, LOST, POINTS, TOLERANCE, NOISE = 20.0, 5.0, 4000, 0.2, 0.03
"""Edges of the box and of what is lost of it, number of points, tolerance and noise, in mm."""


@cache
def make_site() -> tuple[SiteFacts, SiteCase, LossCase]:
    """The facts about the site, and what rules and terms measure it on."""
    part, damage = _make_box(SIZE), _make_box(LOST)
    rng = np.random.default_rng(0)
    places, _ = sample_by_area(part, POINTS, rng)
    is_lost = (places < LOST + 1e-9).all(axis=1)
    # the lost skin, seen through the point opposite to the corner, is the inner surface
    places[is_lost] = LOST - places[is_lost]
    aligned = Scan(places + rng.normal(0, NOISE, places.shape), noise=NOISE, spacing=float(np.sqrt(6 / POINTS)) * SIZE)
    field = ScanField.measure(part, aligned, TOLERANCE)
    label = np.where(field.distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    field = replace(field, deviation=replace(field.deviation, label=label))
    members = np.flatnonzero(label == DAMAGE)
    cells = cut_skin(part, aligned.spacing)
    skin = SkinView(cells, *find_seen(cells, field), None)
    coverage = measure_coverage(part, skin, [damage], TOLERANCE, aligned.spacing)
    scan = ScanFacts(TOLERANCE, aligned.spacing, "mm", NOISE, seen_area=part.area)
    case = SiteCase(damage, members, field, scan, skin, coverage, Pose(np.eye(4)))
    loss = Loss(damage, find_inner_faces(damage, part), case.points, Evidence(), BeyondPoints())
    facts = SiteFacts(
        damage.volume, 3 * LOST**2, damage.area, len(members), LOST / 3, LOST, Evidence(),
        (0.95 * damage.volume, 1.05 * damage.volume),
    )  # fmt: skip
    return facts, case, LossCase(loss, field, ScanErrors(measure_pose_error(field), scan, ScannerErrors()))


def _make_box(size: float) -> Part:
    """A cube with a corner at the origin."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    return Part(size * corners, np.array(faces))
