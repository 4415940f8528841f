"""What each damage volume is worth: proven, likely or doubtful, and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import ADDED, Deviation, Evidence, Floats, Pose, Scan
from damageest.checks.coverage import SkinView
from damageest.checks.skin_cells import AVERAGED
from damageest.findings import Surplus, Verdict
from damageest.geometry.voxels import measure_area, number_cubes

SYSTEMATIC = 4.0
"""How many times deeper than the systematic deviation of intact skin a site is to be."""
SMALL = 0.15
"""Systematic deviation, in tolerances, that does not matter: errors of the pose and of the triangles."""
OUTWARD = 0.3
"""Share of a site's area that skin which lies outside by as much has to have, to be the sign of one error."""
ALIKE = 2.0
"""How many times deeper than that skin is high a site is to be."""
AGREE = 0.6
"""Difference of the views, in tolerances, in four fifths of their overlap, up to which they agree."""
FEWEST_OUTSIDE = 3
"""Points in a cube of skin that lies outside; fewer may be noise."""
FEWEST_OF_VIEW = 4
"""Points of a view in a cube, for its mean to be compared."""
WIDE, THIN = 0.12, 4.0
"""A site over a larger share of the skin than the first, and shallower in tolerances than the second, may be an error
of a fitted pose that no unworn skin is known to hold: worn metal, or a part of another size, moves it."""
LAYER = 5.0
"""Height in tolerances up to which points outside count as such skin; higher ones are added metal."""
FEW, TOO_FEW = 100, 12
"""Scan points below which a site's volume is a rough figure, and below which stray points explain it."""
MIXED = 0.3
"""Share of intact points over a site from which its rim is not clear."""
BARE = 0.25
"""Share of a site's inner surface without scan points from which its volume is open; from twice that it is doubtful."""
GAP = 8.0
"""The same for a connected piece of it: its area in squares of the scan's spacing, or of the tolerance."""
OPEN = 0.08
"""Share from which such a piece makes a site doubtful: of the inner surface; for a site that rays prove, of the damage
volume's whole surface, since the root of a thin wall is small."""
SHALLOW = 1.5
"""Depth in tolerances below which a site is shallow: its rim is then as wide as itself."""
UNSEEN = 0.5
"""Share of the skin beside a site from which nothing shows where the damage ends."""


@dataclass(frozen=True)
class ScanLimits:
    """What the whole scan cannot tell apart from damage, in the job's ``unit``.

    ``systematic``: standard deviation of the mean distances of intact cells of the skin that noise does not explain.
    ``outward_area`` and ``outward_height``: skin that lies outside the part by some tolerances, and by how much. No
    damage does that, so a site of like depth may come from the same error. ``between_views``: how far the views of the
    scan differ where they overlap, 0 where they agree or are not known. ``seen_area``: skin that the scan shows;
    ``is_fitted``: whether the pose was fitted to the scan, and no unworn skin is known to hold it.
    """

    tolerance: float
    spacing: float
    unit: str
    seen_area: float = 0.0
    is_fitted: bool = False
    systematic: float = 0.0
    outward_area: float = 0.0
    outward_height: float = 0.0
    between_views: float = 0.0


def measure_limits(
    skin: SkinView,
    aligned: Scan,
    deviation: Deviation,
    surplus: Iterable[Surplus],
    tolerance: float,
    unit: str,
    is_fitted: bool,
) -> ScanLimits:
    """Measures how far skin deviates that is not damaged. ``surplus``: higher one is left out, since it is metal."""
    systematic = 0.0
    distance = skin.distance[skin.perhaps_seen & np.isfinite(skin.distance)]
    if len(distance) >= 30:
        # half the width of the middle 90 %, in standard deviations of a normal distribution
        low, high = np.quantile(distance, [0.05, 0.95])
        spread = float(max(-low, high)) / 1.645
        systematic = float(np.sqrt(max(spread**2 - aligned.noise**2 / AVERAGED, 0.0)))
    layer = (deviation.label == ADDED) & (deviation.distance < LAYER * tolerance)
    for one in surplus:
        if one.height > LAYER * tolerance or one.kind == "surroundings":
            layer[one.points] = False
    area, height = 0.0, 0.0
    if layer.any():
        area = measure_area(aligned.points[layer], skin.cells.edge, FEWEST_OUTSIDE)
        height = float(np.quantile(deviation.distance[layer], 0.9))
    seen = float(skin.cells.areas[skin.seen].sum())
    apart = _compare_views(aligned, deviation, skin.cells.edge, tolerance)
    return ScanLimits(tolerance, aligned.spacing, unit, seen, is_fitted, systematic, area, height, apart)


def _compare_views(aligned: Scan, deviation: Deviation, edge: float, tolerance: float) -> float:
    """How far the mean distances of the views differ in cubes that several views show; 0 where they agree."""
    if aligned.view is None:
        return 0.0
    used = np.flatnonzero((aligned.view >= 0) & (np.abs(deviation.distance) < LAYER * tolerance))
    if not len(used):
        return 0.0
    cube = np.unique(number_cubes(aligned.points[used], edge)[1], return_inverse=True)[1]
    pair, group, count = np.unique(
        cube * (int(aligned.view.max()) + 1) + aligned.view[used], return_inverse=True, return_counts=True
    )
    mean = np.bincount(group, weights=deviation.distance[used]) / count
    many = count >= FEWEST_OF_VIEW
    owner, mean = pair[many] // (int(aligned.view.max()) + 1), mean[many]
    low, high = np.full(int(cube.max()) + 1, np.inf), np.full(int(cube.max()) + 1, -np.inf)
    np.minimum.at(low, owner, mean)
    np.maximum.at(high, owner, mean)
    shared = np.bincount(owner, minlength=len(low)) > 1
    if shared.sum() < 30:
        return 0.0
    apart = (high - low)[shared]
    return float(np.quantile(apart, 0.98)) if float(np.quantile(apart, 0.8)) > AGREE * tolerance else 0.0


@dataclass
class _Reasons:
    """Reasons against a site, and questions that stay open about it, as they are found."""

    against: list[str]
    questions: list[str]
    is_by_form: bool = False

    def add(self, is_against: bool, text: str) -> None:
        (self.against if is_against else self.questions).append(text)

    def add_form(self, is_against: bool, text: str) -> None:
        """As `add`, where skin that deviates would explain the site."""
        self.add(is_against, text)
        self.is_by_form |= is_against


def judge_site(
    evidence: Evidence, depth: Floats, area: float, pose: Pose, limits: ScanLimits, proven_by_rays: bool,
    volume_area: float, unknown: tuple[str, ...] = (), doubts: tuple[str, ...] = (),
) -> Verdict:  # fmt: skip
    """Weighs all that speaks for and against a damage volume.

    Args:
        depth: (M,) depth of each of its scan points below the skin, in the job's unit.
        area: skin that these points cover.
        proven_by_rays: whether rays passed through the metal that it removes. Points on it then need not be many.
        volume_area: area of the whole surface of the damage volume.
        unknown: what the scan does not show of it. doubts: what else makes it doubtful, such as a displaced piece.
    """
    found = _Reasons([*pose.doubts, *doubts], list(unknown))
    for cause, reason in zip(evidence.causes, evidence.reasons, strict=True):
        if proven_by_rays and cause in ("bare", "unseen", "shallow"):
            continue  # rays stand for the points, and a thin wall's root is all rim
        found.add(cause != "unseen" or evidence.skin_unseen > UNSEEN, reason)
    if len(depth):
        _ask_depth(found, depth, area, limits)
    if proven_by_rays:
        _ask_open_inside(found, evidence.ids_gap / max(volume_area, 1e-300), evidence.ids_gap, limits.unit)
    else:
        _ask_inner_surface(found, evidence, limits)
        _ask_points(found, evidence, depth, limits)
    if found.against:
        return Verdict("doubtful", (*found.against, *found.questions), found.is_by_form)
    return Verdict("likely" if found.questions else "proven", tuple(found.questions))


def _ask_open_inside(found: _Reasons, share: float, gap: float, unit: str) -> None:
    """Rays prove that skin is gone, and not how deep the loss reaches behind it."""
    if share > OPEN / 2:
        found.add(
            share > OPEN,
            f"its inner surface has {gap:.3g} {unit}² without scan points in one piece, {share:.0%} of the surface of "
            "the damage volume: it may be deeper there",
        )


def _ask_inner_surface(found: _Reasons, evidence: Evidence, limits: ScanLimits) -> None:
    gap = evidence.ids_gap / max(limits.tolerance, limits.spacing) ** 2
    if gap > GAP or evidence.ids_unseen > BARE:
        found.add(
            (gap > 2 * GAP and evidence.ids_unseen > OPEN) or evidence.ids_unseen > 2 * BARE,
            f"{evidence.ids_unseen:.0%} of its inner surface has no scan points near, {evidence.ids_gap:.3g} "
            f"{limits.unit}² in one piece: it may be deeper there",
        )


def _ask_depth(found: _Reasons, depth: Floats, area: float, limits: ScanLimits) -> None:
    typical, deepest = (float(np.quantile(depth, q)) for q in (0.5, 0.95))
    unit = limits.unit
    if limits.systematic > SMALL * limits.tolerance and typical < SYSTEMATIC * limits.systematic:
        found.add_form(
            deepest < SYSTEMATIC * limits.systematic,
            f"it is {deepest:.3g} {unit} deep, and intact skin deviates by {limits.systematic:.3g} {unit} over whole "
            "areas (pose, form of the part, or scanner)",
        )
    if limits.outward_area > OUTWARD * area and typical < ALIKE * limits.outward_height:
        found.add_form(
            deepest < ALIKE * limits.outward_height,
            f"it is {deepest:.3g} {unit} deep, and {limits.outward_area:.3g} {unit}² of the scan lie up to "
            f"{limits.outward_height:.3g} {unit} outside the part: both may come from one error (scale, pose, form of "
            "the part, or scanner)",
        )
    if limits.between_views and typical < 1.5 * limits.between_views:
        found.add_form(
            True, f"the views of the scan differ by up to {limits.between_views:.3g} {unit} where they overlap"
        )
    if limits.is_fitted and area > WIDE * limits.seen_area and typical < THIN * limits.tolerance:
        found.add_form(
            True,
            f"it covers {area / limits.seen_area:.0%} of the skin that the scan shows, {typical:.3g} {unit} deep, and "
            "the pose was fitted to the scan: worn or deviating skin moves the pose, and the loss may lie elsewhere; "
            "where the pose is known, give it to align: none",
        )


def _ask_points(found: _Reasons, evidence: Evidence, depth: Floats, limits: ScanLimits) -> None:
    count = len(depth)
    if not count or float(np.quantile(depth, 0.95)) < SHALLOW * limits.tolerance:
        found.add(False, f"it is less than {SHALLOW:g} tolerances deep: its rim fades out below the tolerance")
    if count < FEW:
        found.add(
            count < TOO_FEW,
            f"only {count} scan points lie on it" + ("; stray points explain it" if count < TOO_FEW else ""),
        )
    if evidence.consistent and evidence.intact_share > MIXED:
        found.add(
            False,
            f"intact points lie on {evidence.intact_share:.0%} of the skin that it removes: its rim is not clear",
        )
