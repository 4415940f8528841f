"""The step that measures how exactly the volumes are known, of each site and in total."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.checks.coverage import find_removed_cells
from damageest.checks.fading import measure_fading
from damageest.checks.pose_error import PoseError, measure_pose_error
from damageest.checks.scan_quality import describe_few
from damageest.checks.uncertainty import (
    WIDTH,
    SiteError,
    combine_site,
    combine_total,
    describe_fading,
    limit_beside,
    measure_site_error,
)
from damageest.findings import Fading, Interval, Uncertainty
from damageest.geometry.skin import find_inner_faces
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.form import measure_at_site
from damageest.pipeline.state import FoundSite, JobState, Work
from damageest.stages.allowance import Allowance

COARSE = 0.05
"""Point spacing, in diagonals of the part, from which a loss between the points can be of any size."""
BESIDE = 2.0
"""Distance from a damage volume, in reaches, within which unseen skin may be part of the same loss."""


def measure_uncertainty(engine: Engine, work: Work) -> Work:
    """Gives each site the 95 % intervals of its volume and depth, and the job that of the total.

    A site that is doubtful has none: what contradicts it is not an error that has a size. The total has one where each
    accepted site has one, and no damage was left without a volume. Doubtful sites that are not accepted make it wide:
    they may be damage, too. Where no site was found in a scan that could not show one, it is not known either.
    """
    state = work.job
    if not work.sites:
        total = None if work.failures or _may_hide_loss(state) else (0.0, 0.0)
        return replace(work, job=state.with_value(JobState.volume_95, total, digest("no sites", total is None)))
    free = _list_free_motions(state)
    pose = measure_pose_error(state.part, state.aligned, state.deviation, state.tolerance, free)
    sites, errors, taken = [], [], _TakenSkin(state, work.sites)
    for site in work.sites:
        uncertainty, error = _measure_site(state, site, taken, pose)
        sites.append(replace(site, uncertainty=uncertainty))
        if site.accepted:
            errors.append(error)
    known = [error for error in errors if error is not None]
    lost = [error for error in work.failures if error.stage != Allowance.stage]
    total = None
    if len(known) == len(errors) and not lost:
        # collect_result moves it to the volume of the union, which is the same but for overlaps
        volume = sum(site.damage.volume for site in sites if site.accepted)
        total = combine_total(volume, known, sum(site.damage.volume for site in sites if not site.accepted))
    key = digest("interval", total, [site.key("damage") for site in sites])
    return replace(work, sites=tuple(sites), job=state.with_value(JobState.volume_95, total, key))


def _measure_site(
    state: JobState, site: FoundSite, taken: _TakenSkin, pose: PoseError
) -> tuple[Uncertainty, SiteError | None]:
    """A site's uncertainty, and its errors, None where there is no interval."""
    if site.verdict.level == "doubtful":
        return Uncertainty(None, None, reasons=("no interval, since the site is doubtful",)), None
    points = state.aligned.points[site.members]
    inner = find_inner_faces(site.damage, state.part)
    # what the model fit gives is the 95 % bound of a deviation
    error = measure_site_error(
        site.damage, inner, state.part, state.aligned, points, site.evidence, pose, state.tolerance,
        form=measure_at_site(state, site) / WIDTH,
    )  # fmt: skip
    if error is None:
        return Uncertainty(None, None, reasons=("no interval, since no scan points lie on its inner surface",)), None
    reach = BESIDE * max(2 * state.tolerance, 1.5 * state.aligned.spacing)
    fading = _measure_fading(state, site, inner, taken, pose)
    error = replace(
        error,
        beside=limit_beside(state.coverage, site.damage, reach, error.depth),
        fading=fading.beyond if fading else 0.0,
    )
    volume, depth = combine_site(error)
    reasons = []
    if error.beside > 0:
        reasons.append(
            f"skin beside it is not seen: the loss may be larger there by up to {error.beside:.3g} {state.unit}³"
        )
    if error.inside > 0:
        reasons.append(
            f"its inner surface has no scan points in one piece of {site.evidence.ids_gap:.3g} {state.unit}²: the loss "
            f"may be larger there by up to {error.inside:.3g} {state.unit}³, and deeper than any scan point shows"
        )
    if fading:
        reasons.append(describe_fading(fading, error.volume, state.unit, state.tolerance))
    uncertainty = Uncertainty(
        volume_95=volume,
        depth_95=depth,
        noise=error.noise,
        spacing=error.spacing,
        rim=error.rim,
        pose=float(np.linalg.norm(error.pose)),
        tessellation=error.tessellation,
        form=error.form,
        inside=error.inside,
        beside=error.beside,
        fading=fading,
        reasons=tuple(reasons),
    )
    return uncertainty, error


def _may_hide_loss(state: JobState) -> bool:
    """Whether there are too few points to say that nothing is lost: so few or so far apart that they do not show the
    part, or far apart for the tolerance with points too deep for noise, which are in no site."""
    scan, tolerance = state.aligned, state.tolerance
    if describe_few(scan) or scan.spacing > COARSE * state.part.diagonal:
        return True
    return scan.spacing > tolerance and bool((state.deviation.distance < -2 * tolerance).any())


def _list_free_motions(state: JobState) -> Floats | None:
    """The motions that the scan does not fix: (6,F), a turn and a shift about the centre of the part's bounds, each as
    far as it may go; None where there is none."""
    centre = state.part.bounds.mean(axis=0)
    columns = []
    for one in state.pose.free:
        far, direction = max(-one.low, one.high), np.array(one.direction)
        turn = np.zeros(3) if one.point is None else one.turn * direction
        shift = direction if one.point is None else np.cross(turn, centre - np.array(one.point))
        columns.append(far / WIDTH * np.concatenate([turn, shift]))
    return np.column_stack(columns) if columns else None


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
