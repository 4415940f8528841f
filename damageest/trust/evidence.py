"""The check of a damage volume (DV) against the scan, independent of the method that made the DV.

A right DV has its IDS points on its boundary, no intact point inside it or on the skin that it removes, and scan points
all over its inner surface. The wrong side, a second site enclosed by mistake, a flat cap each break one of these.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import (
    ADDED,
    INTACT,
    Evidence,
    EvidenceCause,
    Flags,
    Floats,
    Part,
    Solid,
)
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.neighbourhoods import find_in_box, pick_one_per_cube
from damageest.geometry.point_pieces import number_pieces
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces, take_lost_skin
from damageest.geometry.threads import count_threads
from damageest.trust.skin.unseen_rim import face_alike

MOST = 10_000
"""Points looked at for each figure: a share is right to about half a percent."""
FEWEST_INTACT = 4
"""Intact points over a damage volume below which they do not contradict it."""
HALF = 0.5
"""Share of intact points over a damage volume from which they contradict it. On the rim of a pit two tolerances deep, a
quarter of its area is shallower than half a tolerance."""
UNSEEN = 0.25
"""Share of the skin beside a damage volume that may be unseen, before the other method is tried too."""


def weigh_evidence(damage: Solid, ids_points: Floats, field: ScanField) -> Evidence:
    """Compares one DV with the scan. ``ids_points`` (M,3): the site's IDS points; ``field``: that of the whole scan."""
    part, spacing, tolerance = field.part, field.aligned.spacing, field.tolerance
    reach = max(2.0 * tolerance, 1.5 * spacing)
    low, high = damage.bounds[0] - 8 * reach, damage.bounds[1] + 8 * reach  # all that shows the skin beside it
    here = find_in_box(field.points, low, high)
    points, label = field.points[here], field.label[here]
    ids = ids_points[:: max(1, len(ids_points) // (MOST // 4))]
    residual = float(np.quantile(distance_to_mesh(ids, damage), 0.95))

    inner = find_inner_faces(damage, part)
    on_ids = _spread(damage, inner, MOST // 2)
    on_skin = _spread(damage, ~inner, MOST // 2)
    gaps = _measure_gap(on_ids, points, 1.5 * reach)
    bare = float((gaps > 1.5 * reach).mean()) if len(on_ids) else 0.0
    far = gaps > max(1.5 * tolerance, 1.6 * spacing)
    ids_unseen = float(far.mean()) if len(on_ids) else 0.0
    ids_gap = _measure_largest_gap(on_ids, far, float(damage.face_areas[inner].sum()), spacing)
    # Close to the rim, intact points are near any skin. So only skin away from the inner surface is compared.
    intact = points[label == INTACT]
    grain = float(np.sqrt(2 * damage.face_areas[~inner].sum() / MOST))
    close = tolerance + 4 * grain
    intact = intact[_measure_gap(intact, on_skin, close) <= close]
    intact = intact[_measure_gap(intact, on_ids, 1.5 * reach) > 1.5 * reach]
    if len(intact):  # against the skin's few faces first: most points are beside the damage volume
        skin_only = take_lost_skin(damage, inner)
        intact = intact[distance_to_mesh(intact, skin_only) < tolerance]
    inside, contradicted = 0, 0.0
    if len(intact):
        distance, face, _ = closest_on_mesh(intact, damage)
        taken = intact[(distance < tolerance) & ~inner[face]]
        inside = len(taken)
        asked = on_skin[_measure_gap(on_skin, on_ids, 1.5 * reach) > 1.5 * reach]
        contradicted = 1 - _share_far(asked, taken, max(spacing, tolerance)) if len(asked) > 20 else 0.0
    covered = _find_covered(field, low, high, reach)
    unseen = _share_unseen(part, damage, inner, np.concatenate([points, covered]), on_skin, reach)
    over = _count_intact_over(damage, inner, field)
    # as many as on intact skin of this area, or as many as there are points of the site: either shows intact skin
    skin_area = float(damage.face_areas[~inner].sum())
    expected = min(len(ids_points) + over, skin_area * (1.1 / spacing) ** 2 if spacing else np.inf)
    intact_share = float(min(over / max(expected, 1.0), 1.0)) if over >= FEWEST_INTACT else 0.0

    found: dict[EvidenceCause, bool] = {
        "residual": residual > 1.5 * tolerance + 0.25 * spacing,
        "inside": inside > max(10, 0.02 * len(ids_points)),
        "contradicted": contradicted > 0.1,
        "bare": bare > 0.1,
        "shallow": intact_share > HALF,
        "unseen": unseen > UNSEEN,
    }
    causes = tuple(cause for cause, is_found in found.items() if is_found)
    return Evidence(residual, inside, contradicted, unseen, ids_unseen, ids_gap, intact_share, not causes, causes)


def _measure_largest_gap(places: Floats, chosen: Flags, area: float, spacing: float) -> float:
    """Area of the largest connected piece of the chosen places (N,), which are spread evenly over an ``area``."""
    if not chosen.any():
        return 0.0
    each = area / len(places)
    piece = number_pieces(places[chosen], max(0.7 * spacing, 2 * float(np.sqrt(each))))
    return float(np.bincount(piece).max() * each)


def _count_intact_over(damage: Solid, inner: Flags, field: ScanField) -> float:
    """How many intact scan points lie on the skin that a DV removes: those nearer to it than half a tolerance."""
    tolerance = field.tolerance
    here = find_in_box(field.points, damage.bounds[0] - tolerance, damage.bounds[1] + tolerance)
    here = here[(field.label[here] == INTACT) & (np.abs(field.distance[here]) < 0.5 * tolerance)]
    if not len(here):
        return 0.0
    step = max(1, len(here) // MOST)
    here = here[::step]
    feet = field.find_feet(here)
    skin_only = take_lost_skin(damage, inner)
    if not len(skin_only.faces):
        return 0.0
    feet = feet[
        distance_to_mesh(feet, skin_only) < 0.02 * tolerance
    ]  # its faces are few, and most points are not there
    if not len(feet):
        return 0.0
    distance, face, _ = closest_on_mesh(feet, damage)
    return float(step * ((distance < 0.02 * tolerance) & ~inner[face]).sum())


def _measure_gap(places: Floats, points: Floats, most: float) -> Floats:
    """Distance (N,) from each place to the nearest of the points; inf beyond ``most``."""
    from scipy.spatial import cKDTree

    if not len(places) or not len(points):
        return np.full(len(places), np.inf)
    return np.asarray(cKDTree(points).query(places, distance_upper_bound=1.001 * most, workers=count_threads())[0])


def _share_far(places: Floats, points: Floats, distance: float) -> float:
    """Share of the places (N,3) that have no point within a distance."""
    return float((_measure_gap(places, points, distance) > distance).mean()) if len(places) else 0.0


def _find_covered(field: ScanField, low: Floats, high: Floats, reach: float) -> Floats:
    """Places (K,3) on the skin in the box from ``low`` to ``high`` (3,) below points on added metal."""
    added = np.flatnonzero(field.label == ADDED)
    if not len(added):
        return np.empty((0, 3))
    height = float(field.distance[added].max())
    above = field.points[added]
    above = above[find_in_box(above, low - height, high + height)]
    return closest_on_mesh(above[pick_one_per_cube(above, 0.5 * reach)], field.part).place if len(above) else above


def _share_unseen(part: Part, damage: Solid, inner: Flags, points: Floats, on_skin: Floats, reach: float) -> float:
    """Share of the part's skin beside the DV that has no scan point. The other side of a thin wall is not beside it."""
    if not len(on_skin):
        return 0.0
    low, high = damage.bounds[0] - 6 * reach, damage.bounds[1] + 6 * reach
    near = np.ones(len(part.faces), bool)
    for along, least, most in zip(part.vertices.T, low, high, strict=True):
        near &= (along < most)[part.faces].any(axis=1) & (along > least)[part.faces].any(axis=1)
    area = float(part.face_areas[near].sum())
    if not area > 0:
        return 0.0
    count = int(np.clip(area / (0.7 * reach) ** 2, 1000, 2 * MOST))
    skin, face = sample_by_area(part, count, np.random.default_rng(0), np.flatnonzero(near))
    close = _measure_gap(skin, on_skin, 6 * reach) < 6 * reach
    skin, face = skin[close], face[close]
    if not len(skin):
        return 0.0
    away = distance_to_mesh(skin, damage)
    in_ring = (away > 2 * reach) & (away < 6 * reach)
    ring = skin[in_ring]
    ring = ring[face_alike(ring, part.face_normals[face[in_ring]], damage, inner)]
    return _share_far(ring, points, 2 * reach) if len(ring) > 20 else 0.0


def _spread(mesh: Solid, chosen: Flags, count: int) -> Floats:
    """``count`` points spread evenly by area over the chosen faces; none where these have no area."""
    if not (mesh.face_areas[chosen].sum() > 0):
        return np.empty((0, 3))
    return sample_by_area(mesh, count, np.random.default_rng(0), np.flatnonzero(chosen))[0]
