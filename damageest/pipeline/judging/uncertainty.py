"""Steps that measure how exactly the volumes are known, of each site and in total."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Ints, Solid
from damageest.findings import Budget, Fading, Interval, Uncertainty
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces
from damageest.pipeline.finding.lost_bodies import BY_RAYS_ALONE
from damageest.pipeline.finding.pores import PORE
from damageest.pipeline.placing.form import measure_at_site
from damageest.pipeline.state import FoundSite, JobState
from damageest.pipeline.steps import step
from damageest.stages.adapt import Adapt
from damageest.stages.allowance import Allowance
from damageest.stages.path import Path
from damageest.trust.beyond_points import measure_beyond_points
from damageest.trust.doubts.dent import find_bent_wall
from damageest.trust.interval.budget import make_depth_budget, make_volume_budget
from damageest.trust.interval.fading import measure_fading
from damageest.trust.interval.free_pose import measure_dependence, measure_hidden_wear
from damageest.trust.interval.inner_surface import measure_inner_surface
from damageest.trust.interval.loss import Loss, LossCase, measure_shifts
from damageest.trust.interval.pose_error import PoseError
from damageest.trust.interval.scanner import TERMS
from damageest.trust.interval.shallow_loss import limit_shallow_loss
from damageest.trust.interval.site_error import (
    WIDTH,
    Share,
    SiteError,
    combine_site,
    combine_total,
    measure_certain,
    sum_free,
)
from damageest.trust.interval.uncertainty import measure_site_error
from damageest.trust.scan_quality import describe_few
from damageest.trust.skin.coverage import find_removed_cells
from damageest.trust.terms.noise import Noise
from damageest.trust.terms.spacing import Spacing
from damageest.trust.views.view_overlap import compare_at_site

COARSE = 0.05
"""Point spacing, in diagonals of the part, from which a loss between the points can be of any size."""
ROUGH = 0.1
"""Standard deviation of where the closed surface of a pore lies, in gaps between its points."""


@step(
    gives="found",
    reads=(
        "found",
        "part",
        "aligned",
        "field",
        "adapted",
        "skin",
        "coverage",
        "errors",
        "fitted",
        "pose",
        "terms",
        "tolerance",
        "unit",
        "adapter",
        "warnings",
    ),
)
def measure_uncertainty(state: JobState) -> tuple[FoundSite, ...]:
    """Gives each site the 95 % intervals of its volume and depth, with all causes that have a size."""
    if not state.found:
        return state.found
    taken = _TakenSkin(state, state.found)
    pose = state.errors.pose.leave_out(state.pose.free, state.part.diagonal / 4)
    return tuple(_measure_site(state, site, taken, pose) for site in state.found)


@step(
    gives=("volume_95", "budget"),
    reads=(
        "found", "failures", "pose", "field", "adapted", "folded", "views", "sensor", "unit",
    ),
)  # fmt: skip
def sum_uncertainty(state: JobState) -> tuple[Interval | None, Budget | None]:
    """Gives the job the 95 % interval of its total volume, and its budget."""
    adapted, views = state.adapted, state.views
    hidden = (adapted.hidden if adapted else 0.0) + state.folded + (views.hidden if views else 0.0)
    volume_95 = _sum_volume(state, hidden)
    return volume_95, None if volume_95 is None else _sum_budget(state, hidden)


def _sum_volume(state: JobState, hidden: float) -> Interval | None:
    """The 95 % interval of the total volume. ``hidden``: volume that was taken for form, errors or views.

    There is one where each accepted site has one, and no damage was left without a volume. Sites that are not accepted
    make its high end larger: they may be damage, too, as may what an adapted part's field took for form, and what was
    taken for a misplaced view. Where no site
    was found, its high end is what may lie below the tolerance and between the points; in a scan that could not show a
    site, or in a pose that is doubted, it is not known either.
    """
    found, failures, pose, field = state.found, state.failures, state.pose, state.field
    if not found:
        is_unknown = failures or pose.doubts or _may_hide_loss(field)
        if is_unknown:
            return None
        shallow = limit_shallow_loss(field, state.sensor.least_width)
        return 0.0, measure_hidden_wear(field.part, pose) + hidden + shallow
    after = (Allowance.stage, Path.stage)  # they change no loss
    lost = [error for error in failures if error.stage not in after]
    taken = [site for site in found if site.accepted]
    errors = [site.error for site in taken if site.error is not None]
    if len(errors) != len(taken) or lost:
        return None
    # collect_result moves it to the volume of the union, which is the same but for overlaps
    left = hidden + _sum_doubtful(found)
    total = combine_total(sum(site.damage.volume for site in taken), errors, left)
    is_open = any(site.uncertainty and site.uncertainty.is_open for site in taken)
    return (total[0], math.inf) if is_open else total


def _sum_budget(state: JobState, hidden: float) -> Budget | None:
    """The budget of the total volume; None where there is no site."""
    errors = [site.error for site in state.found if site.accepted and site.error is not None]
    if not errors:
        return None
    return make_volume_budget(errors, state.unit, hidden + _sum_doubtful(state.found), sum_free(errors))


def _sum_doubtful(found: tuple[FoundSite, ...]) -> float:
    """The volume of sites that are not accepted, and may be damage."""
    return sum(limit_doubtful(site) for site in found if not site.accepted)


def limit_doubtful(site: FoundSite) -> float:
    """How large the loss of a site that is not accepted may be: the high end of its interval without what opens it.
    What contradicts the site does not open the total."""
    return combine_site(site.error)[0][1] if site.error else site.damage.volume


def _measure_site(state: JobState, site: FoundSite, taken: _TakenSkin, pose: PoseError) -> FoundSite:
    """The site with its uncertainty and its errors; the latter are None where there is no interval."""
    if site.method == BY_RAYS_ALONE:  # a whole body of the part: its volume is known
        known = site.damage.volume
        error = SiteError(known)
        return replace(site, uncertainty=Uncertainty((known, known), None), error=error)
    if site.method == PORE:
        return _measure_pore(state, site)
    points = state.aligned.points[site.members]
    inner = find_inner_faces(site.damage, state.part)
    beyond = measure_beyond_points(site.damage, state.field, points, state.unit)
    site = replace(site, beyond=beyond)
    differ = WIDTH * compare_at_site(state.field, site.members, state.skin.cells.edge)
    facts = replace(state.errors.facts, between_views=max(state.errors.facts.between_views, differ))
    loss = Loss(site.damage, inner, points, site.evidence, beyond)
    errors = replace(state.errors, pose=pose, facts=facts)
    # what the model fit gives is the 95 % bound of a deviation
    fading = _measure_fading(state, site, inner, taken, pose)
    bent_wall = find_bent_wall(site.damage, state.skin, state.field, site.members)
    case = LossCase(
        loss, state.field, errors, _measure_form(state, site), state.adapted, state.coverage, fading, bent_wall
    )
    found = measure_site_error(case, state.terms, state.pose.free)
    if found is None:
        return replace(site, uncertainty=Uncertainty(None, None))
    dependences = measure_dependence(site.damage, state.part, state.pose)
    extrapolated, extrapolated_error = _measure_extrapolated(state, site.damage, inner)
    error = replace(
        found,
        rates=np.append(found.rates, [one.rate for one in dependences]),
        motions=np.concatenate([found.motions, *([[one.motion.low, one.motion.high]] for one in dependences)]),
    )
    uncertainty = replace(
        _describe(error, state.unit),
        extrapolated=extrapolated,
        extrapolated_error=extrapolated_error,
        fading=fading,
        certain=measure_certain(error),
    )
    return replace(site, uncertainty=uncertainty, error=error, dependences=dependences, bent_wall=bent_wall)


def _measure_pore(state: JobState, site: FoundSite) -> FoundSite:
    """A pore with its uncertainty: no rim and no skin are near, so that noise and the gaps between the points count."""
    points, noise = state.aligned.points[site.members], state.aligned.noise
    all_inner = np.ones(len(site.damage.faces), bool)
    surface = measure_inner_surface(site.damage, all_inner, points, noise, state.aligned.spacing, state.tolerance)
    if surface is None:
        return replace(site, uncertainty=Uncertainty(None, None))
    deepest = float(-state.field.distance[site.members].min())
    shares = (
        (Noise(), Share(surface.noise, noise, noise)),
        (Spacing(), Share(ROUGH * surface.gap * site.damage.area, surface.gap / 2)),
    )
    error = SiteError(site.damage.volume, shares, depth=deepest)
    return replace(site, uncertainty=_describe(error, state.unit), error=error)


def _describe(error: SiteError, unit: str) -> Uncertainty:
    """What the errors of a site say of its volume and depth: intervals, terms and budgets."""
    volume, depth = combine_site(error)
    by_term = error.measure_terms()
    bounds = {term.name: share.high for term, share in error.shares}
    known = {one.name for one in fields(Uncertainty)} - {"inside", "beside", "fading"}
    scanner = [size for name, size in by_term.items() if name in TERMS]
    return Uncertainty(
        volume,
        depth,
        free=error.free,
        inside=bounds.get("inside", 0.0),
        beside=bounds.get("beside", 0.0),
        scanner=float(np.linalg.norm(scanner)) if scanner else 0.0,
        budget=make_volume_budget([error], unit, free=error.free),
        depth_budget=make_depth_budget(error, unit),
        **{name: size for name, size in by_term.items() if name in known},  # type: ignore[arg-type]
    )


def _measure_form(state: JobState, site: FoundSite) -> float:
    """The standard deviation by which a form that fits the skin moves that of a site; 0 where stage `adapt` was asked
    for that form and did not take it: the patches of the skin tell what it leaves."""
    was_asked = state.adapter is not None and state.adapter.deforms and state.adapted is None
    if was_asked and not any(note.code == Adapt.stage for note in state.warnings):
        return 0.0
    return measure_at_site(state.fitted, state.field, site.members) / WIDTH


def _may_hide_loss(field: ScanField) -> bool:
    """Whether there are too few points to say that nothing is lost: so few or so far apart that they do not show the
    part, or far apart for the tolerance with points too deep for noise, which are in no site."""
    scan, tolerance = field.aligned, field.tolerance
    if describe_few(scan) or scan.spacing > COARSE * field.part.diagonal:
        return True
    return scan.spacing > tolerance and bool((field.distance < -2 * tolerance).any())


def _measure_extrapolated(state: JobState, damage: Solid, inner: Flags) -> tuple[float, float]:
    """How far skin that a site removes is from intact points, at most, and the largest standard deviation of the
    adapted skin there; 0 where the part is as designed."""
    adapted = state.adapted
    if adapted is None or inner.all():
        return 0.0, 0.0
    from scipy.spatial import cKDTree

    intact = state.field.intact
    places, normals = damage.triangles[~inner].mean(axis=1), damage.face_normals[~inner]
    far = float(np.max(cKDTree(intact).query(places)[0])) if len(intact) else 0.0
    moved = measure_shifts(adapted.part, adapted.modes, places, normals)
    return far, float(np.hypot(np.sqrt((moved**2).sum(axis=0)).max(initial=0.0), adapted.unfollowed))


def _measure_fading(
    state: JobState, site: FoundSite, inner: Flags, taken: _TakenSkin, pose: PoseError
) -> Fading | None:
    noise, tolerance = state.aligned.noise, state.tolerance
    return measure_fading(
        site.damage, inner, state.skin, noise, pose.systematic, tolerance, lambda: taken.find_others(site)
    )


class _TakenSkin:
    """Which cells of the skin the sites remove. Each site is looked at once, when this is first asked."""

    def __init__(self, state: JobState, sites: tuple[FoundSite, ...]) -> None:
        self._state, self._sites = state, sites

    @cached_property
    def _counts(self) -> Ints:
        counts = np.zeros(len(self._state.skin.cells.areas), np.int64)
        for site in self._sites:
            counts += find_removed_cells(site.damage, self._state.skin)
        return counts

    def find_others(self, site: FoundSite) -> Flags:
        """(C,) the cells that other sites remove."""
        return np.asarray(self._counts - find_removed_cells(site.damage, self._state.skin) > 0)


def shift_interval(interval: Interval | None, more: float) -> Interval | None:
    """The interval of a volume that is larger by ``more``, as by a cut-back, which is exact."""
    return None if interval is None else (max(interval[0] + more, 0.0), interval[1] + more)


def shift_uncertainty(uncertainty: Uncertainty | None, more: float) -> Uncertainty | None:
    """As `shift_interval`, for the interval of a site's volume. The depth is that before a cut-back."""
    if uncertainty is None or not more:
        return uncertainty
    return replace(uncertainty, volume_95=shift_interval(uncertainty.volume_95, more))
