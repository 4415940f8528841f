"""The errors of a site's volume and of its largest depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from damageest.artefacts import AdaptedPart, Evidence, Flags, Floats, FreeMotion, Part, Solid
from damageest.findings import Coverage
from damageest.geometry.barycentric import find_barycentric
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.edges import pair_faces
from damageest.geometry.lost_depth import LostDepth
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import take_inner_surface
from damageest.trust.beyond_points import BeyondPoints
from damageest.trust.doubt import ScanFacts
from damageest.trust.interval.inner_surface import DEPTH_GAP, DEPTH_NOISE, GAP, measure_inner_surface
from damageest.trust.interval.pose_error import PoseError
from damageest.trust.interval.scanner import ScannerErrors, find_shares
from damageest.trust.interval.site_error import WIDTH, SiteError
from damageest.trust.skin.unseen_rim import find_unseen_beside

AVERAGED = 0.01
"""Standard deviation of the inner surface, in tolerances, that all of it has in common: averaged points lie a little
below skin that curves. Worn journals came out by 0.02 tolerances too deep all over."""
HOLE = 0.5
"""Depth that a hole in the scan of an inner surface may hide, in square roots of its area."""
FLAT, SMOOTH = 0.05, 30.0
"""Angles in degrees between triangles that are chords of one curved face."""
OUTWARD = 0.3
"""Share of a site's area that skin which lies outside by some tolerances has to have, to be the sign of one error: no
damage puts skin outside."""
ASKED = 2000
"""Of the deepest scan points of a site, those beside which its volume is looked at."""

AROUND, NOISY, SLOPE = 25, 3.0, 0.7
"""Scan points about the deepest one, it among them, that tell whether it lies in a corner of the inner surface; by how
many standard deviations of their noise the deepest of many points is deeper than those where it does not; and the share
of what it is deeper by, by which a corner goes beyond it: these points are two gaps away, the deepest about one."""
POINT_GAP = 1.1
"""Spacing of points in square roots of the area that each stands for, as `measure_noise_and_spacing` gives it."""
BESIDE = 10.0
"""Distance from a damage volume, in tolerances, up to which what a field made thinner may be the same wear."""
PLACES = 500
"""Places on the skin at which the depth of a site is measured."""
QUANTILES = np.linspace(0.01, 0.99, 50)
"""Those of the depth that are kept of a site."""
MOST = 50_000
"""Scan points whose largest depth is taken."""


@dataclass(frozen=True, eq=False)
class Loss:
    """A loss as it was found: its volume ``damage``, which of its faces (F,) are on the ``inner`` surface, as
    `find_inner_faces` gives them, its scan ``points`` (M,3) in the part's frame, what the scan says of the volume, and
    how that lies ``beyond`` its points."""

    damage: Solid
    inner: Flags
    points: Floats
    evidence: Evidence
    beyond: BeyondPoints


@dataclass(frozen=True, eq=False)
class ScanErrors:
    """The errors that all sites of a scan have in common: of the ``pose``, what the ``facts`` say about skin that
    deviates, and what certificate and temperature say of the ``scanner``."""

    pose: PoseError
    facts: ScanFacts
    scanner: ScannerErrors


class _Place(NamedTuple):
    """``depth`` of a place ``at`` (3,) below the lost skin, and the outward ``normal`` (3,) of that;
    ``measured``: the largest depth of a scan point; ``rise``: by how much those nearest to it are less deep."""

    depth: float
    measured: float
    rise: float
    at: Floats
    normal: Floats


def measure_site_error(
    loss: Loss,
    field: ScanField,
    errors: ScanErrors,
    form: float,
    free: Sequence[FreeMotion],
    adapted: AdaptedPart | None,
) -> SiteError | None:
    """The errors of one site; None where no scan point lies on its inner surface.

    Args:
        form: standard deviation by which the skin deviates systematically, in the job's unit, as a fit of the model
            gives it; where it is less than what the intact skin shows, the latter counts.
        free: motions that the scan does not exclude.
    """
    part, aligned = field.part, field.aligned
    damage, inner, points, evidence, beyond = loss.damage, loss.inner, loss.points, loss.evidence, loss.beyond
    pose, scan, scanner, tolerance = errors.pose, errors.facts, errors.scanner, errors.facts.tolerance
    surface = measure_inner_surface(damage, inner, points, aligned.noise, aligned.spacing, tolerance)
    if surface is None or inner.all():
        return None
    area = damage.face_areas
    skin = ~inner
    skin_area = float(area[skin].sum())
    # what deviates moves the inner surface against the skin: of a wall that broke off, the root alone
    exposed = min(skin_area, float(area[inner].sum()))
    patches = max(1.0, exposed / max(pose.patch_area, 1e-300))
    # what an adapted part leaves of intact skin is what its field is off by there: the same cause, one term
    unfollowed = adapted.unfollowed if adapted else 0.0
    systematic = max(pose.systematic, scan.systematic, unfollowed)
    common = pose.measure_common(damage.triangles[skin].mean(axis=1), area[skin])
    outward = _limit_outward(scan, skin_area)
    curved = _measure_curved(damage, skin, area) if part.tessellation_error else 0.0
    hole = evidence.ids_gap if evidence.ids_gap > GAP * max(tolerance, aligned.spacing) ** 2 else 0.0
    deepest = _find_deepest(damage, inner, part, points, 3 * max(surface.gap, tolerance))
    by_pose = pose.of_distance(deepest.at, deepest.normal)
    bent, bent_depth = measure_adapt(adapted, damage, skin, area, deepest)
    has_other = adapted is not None and adapted.other is not None
    rates = bent[-1:] if has_other else np.empty(0)
    if adapted is not None and adapted.growth:  # of the part, or of the scan's scale: then the loss is of another size
        rates = np.append(rates, damage.volume * ((1 + adapted.growth) ** -3 - 1))
    shares = find_shares(scanner, damage, inner, (deepest.at, deepest.normal), pose, adapted is not None)
    depth_by = {
        "spacing": DEPTH_GAP * surface.gap,
        "noise": DEPTH_NOISE * float(np.hypot(aligned.noise, part.scan_noise)),
        "pose": by_pose,
        "adapt": bent_depth,
        "form": max(form, systematic),
        "tessellation": part.tessellation_error / 3**0.5,
        "probing_form": scanner.form,
    }
    told = float((shares.depth**2).sum())
    beside = sum(depth_by[name] ** 2 for name in depth_by if name not in ("spacing", "noise")) + told
    beside += (DEPTH_NOISE * part.scan_noise) ** 2
    # of skin that is the mean of the points of an earlier scan, each of which stands for an area
    skin_noise = part.scan_noise * float(np.sqrt(skin_area)) * part.scan_spacing / POINT_GAP
    by_point = float(np.sqrt(aligned.noise**2 + beside))
    # in a corner of the inner surface no point may be as deep as it is; where the floor is level, one is
    corner = min(SLOPE * max(deepest.rise - NOISY * aligned.noise, 0.0), WIDTH * depth_by["spacing"])
    return SiteError(
        volume=damage.volume,
        noise=float(np.hypot(surface.noise, skin_noise)),
        spacing=surface.spacing,
        rim=surface.rim,
        excess=surface.excess,
        pose=pose.of_volume(damage.triangles[skin].mean(axis=1), damage.face_normals[skin], area[skin]),
        tessellation=part.tessellation_error * curved / np.sqrt(3),
        # a form that a fit gives is common to the whole site; that of patches as far as they deviate alike
        form=float(max(form, systematic * common, AVERAGED * tolerance) * exposed),
        outward=outward * exposed / WIDTH,
        views=scan.between_views * exposed / WIDTH,
        adapt=bent[:-1] if has_other else bent,
        rates=rates,
        motions=np.tile([0.0, 1.0], (len(rates), 1)),
        inside=HOLE * hole**1.5 + beyond.short,
        less=damage.volume * evidence.ids_unseen if hole else 0.0,
        taken=measure_lowered(adapted, damage, BESIDE * tolerance),
        depth=deepest.depth - surface.depth_excess,
        depth_error=float(np.sqrt(surface.depth**2 + beside)),
        corner=corner,
        measured=deepest.measured + WIDTH * by_point + corner,
        depth_free=sum(
            max(-one.low, one.high) * abs(float(one.move(deepest.at[None])[0] @ deepest.normal)) for one in free
        ),
        # what were common to more than a patch would show in the patches of intact skin
        probing_form=float(scanner.form * exposed / np.sqrt(patches)),
        scanner=shares.volume,
        depth_scanner=shares.depth,
        depth_by=depth_by,
        exposed=exposed,
        depths=_measure_depths(damage, inner),
        curved=curved,
    )


def measure_adapt(
    adapted: AdaptedPart | None, damage: Solid, skin: Flags, area: Floats, deepest: _Place
) -> tuple[Floats, float]:
    """What the errors (J,) of an adapted part's field make of a volume, and the standard deviation of the distance of
    its deepest place to the skin. Last, where there is one, what another field that explains the scan makes of the
    volume. The skin that is gone lies elsewhere by them; the volume ends there."""
    if adapted is None:
        return np.empty(0), 0.0
    fields = adapted.modes if adapted.other is None else np.concatenate([adapted.modes, adapted.other[None]])
    centres = np.concatenate([damage.triangles[skin].mean(axis=1), deepest.at[None]])
    normals = np.concatenate([damage.face_normals[skin], deepest.normal[None]])
    moved = measure_shifts(adapted.part, fields, centres, normals)
    return np.asarray(moved[:, :-1] @ area[skin]), float(np.linalg.norm(moved[: len(adapted.modes), -1]))


def measure_shifts(part: Part, fields: Floats, places: Floats, normals: Floats) -> Floats:
    """How far displacements (J,V,3) of the part's vertices move its skin (J,N) at places (N,3), along normals (N,3)."""
    _, face, at = closest_on_mesh(places, part)
    corners = find_barycentric(part.take_triangles(face), at)
    return np.asarray(np.einsum("nc,jnck,nk->jn", corners, fields[:, part.faces[face]], normals))


def _measure_depths(damage: Solid, inner: Flags) -> Floats:
    """Quantiles of how deep a loss is below places all over the skin that it removes."""
    places, _ = sample_by_area(damage, PLACES, np.random.default_rng(0), np.flatnonzero(~inner))
    return np.asarray(np.quantile(distance_to_mesh(places, take_inner_surface(damage, inner)), QUANTILES))


def measure_lowered(adapted: AdaptedPart | None, damage: Solid, reach: float) -> float:
    """Volume that the field of an adapted part took off beneath a damage volume and within ``reach`` of it, where a
    field that hardly strains the metal leaves it: wear would look the same."""
    if adapted is None or adapted.lowered is None or not adapted.lowered.any():
        return 0.0
    part = adapted.part
    depth = adapted.lowered[part.faces].mean(axis=1)
    some = np.flatnonzero(depth > 0)
    centres = part.triangles[some].mean(axis=1)
    near = ((centres > damage.bounds[0] - reach) & (centres < damage.bounds[1] + reach)).all(axis=1)
    some, centres = some[near], centres[near]
    if not len(some):
        return 0.0
    own = some[distance_to_mesh(centres, damage) < reach]
    return float(depth[own] @ part.face_areas[own])


def _limit_outward(scan: ScanFacts, skin_area: float) -> float:
    """Height up to which the loss may come from the same error as skin that lies outside; 0 where there is too little
    of it."""
    return scan.outward_height if scan.outward_area > OUTWARD * skin_area else 0.0


def limit_beside(coverage: Coverage, damage: Solid, inner: Flags, reach: float, depth: float) -> float:
    """By how much a loss may be larger where skin beside it, within ``reach``, is not seen: over all of that region, as
    deep as it is itself, ``depth``. ``inner`` (F,): which of its faces are inside the part."""
    touched = np.unique(coverage.region[find_unseen_beside(coverage, damage, inner, reach)])
    regions = [coverage.unseen[number] for number in touched]
    return float(sum(min(one.volume, one.area * depth) for one in regions))


def _find_deepest(damage: Solid, inner: Flags, part: Part, members: Floats, reach: float) -> _Place:
    """The deepest place of a damage volume. It is near the deepest scan points, so that the other vertices are not
    asked; ``reach``: how near."""
    lost = LostDepth.build(damage, part, inner)
    vertices = damage.vertices[np.unique(damage.faces[inner])]
    # the maximum of a part of many points would be less than what was measured
    asked = members[:: max(1, len(members) // MOST)]
    depths, _ = lost.measure(asked)
    deep = asked[depths > depths.max() - reach]
    near = vertices[find_nearby(vertices, deep[:: max(1, len(deep) // ASKED)], reach)]
    near = near if len(near) else vertices
    depth, normals = lost.measure(near)
    at, first = int(depth.argmax()), int(depths.argmax())
    _, beside = find_neighbours(asked[first : first + 1], min(AROUND, max(7, len(asked) // 4)), asked)
    rise = float(depths[first] - np.median(depths[beside]))
    if lost.through > depth[at]:
        return _Place(lost.through, max(lost.through, float(depths[first])), rise, lost.middle, normals[at])
    return _Place(float(depth[at]), float(depths[first]), rise, near[at], normals[at])


def _measure_curved(damage: Solid, skin: Flags, area: Floats) -> float:
    """Area of the removed skin that is curved: triangles beside others that turn by a small angle. Chords err there."""
    _, _, first, second = pair_faces(damage.faces)
    between = skin[first] & skin[second]
    first, second = first[between], second[between]
    cosine = np.einsum("ij,ij->i", damage.face_normals[first], damage.face_normals[second])
    turns = (cosine < np.cos(np.radians(FLAT))) & (cosine > np.cos(np.radians(SMOOTH)))
    curved = np.zeros(len(area), bool)
    curved[first[turns]] = True
    curved[second[turns]] = True
    return float(area[curved].sum())
