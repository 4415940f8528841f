"""Steps about parts and scans that one rigid pose does not explain: they are measured, named and, on request, put
right."""

from __future__ import annotations

from dataclasses import replace
from typing import overload

import numpy as np

from damageest.artefacts import Floats, Reason, Scan
from damageest.checks.fit_doubts import find_fit_doubts
from damageest.checks.form_words import describe_fit
from damageest.checks.model_fit import FittedModel, measure_fit
from damageest.checks.scan_quality import choose_tolerance
from damageest.checks.view_fit import fit_views
from damageest.geometry.distance import signed_distance
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import FoundSite, JobState, Work
from damageest.stages.align import Align
from damageest.stages.scan import ReadScan

MEASURED = 40_000
"""Points, about, that the scale is measured with before it is corrected."""


def correct_scan(engine: Engine, work: Work) -> Work:
    """Compares the views, puts misplaced ones right where the alignment fits views, and corrects the scale where the
    job says so."""
    state = work.job
    views = fit_views(
        state.part, state.aligned, state.tolerance, getattr(engine.job.stages.get(Align), "fit_views", False)
    )
    key = digest("views", state.key("aligned"), state.key("part"), state.key("tolerance"))
    state = state.with_value(JobState.views, views, key)
    if views is not None and any(view.is_corrected for view in views.views):
        pose = replace(state.pose, T_part_scan=_make_rigid(views.common @ state.pose.T_part_scan))
        state = state.derive(JobState.pose, pose, JobState.pose, JobState.views)
        state = _take_corrected(engine, state, views.apply(state.aligned))
    scale = 1.0
    if getattr(engine.job.stages.get(ReadScan), "scale", None) == "auto":
        state, scale = _correct_scale(state)
    state = state.with_value(JobState.corrected_scale, scale, digest("scale", key, scale))
    return replace(work, job=state)


def _take_corrected(engine: Engine, state: JobState, aligned: Scan) -> JobState:
    """The state with corrected views: noise, spacing and a tolerance `auto` are measured again."""
    noise, spacing = measure_noise_and_spacing(aligned.points)
    aligned = replace(aligned, noise=noise, spacing=spacing)
    state = state.derive(JobState.aligned, aligned, JobState.aligned, JobState.views)
    state = state.derive(JobState.noise, noise, JobState.aligned)
    state = state.derive(JobState.spacing, spacing, JobState.aligned)
    if engine.job.tolerance is None:
        tolerance = min(state.tolerance, choose_tolerance(None, aligned, state.part)[0])
        state = state.with_value(JobState.tolerance, tolerance, digest(tolerance))
    return state


def _correct_scale(state: JobState) -> tuple[JobState, float]:
    """The state with the scan's scale corrected where it is wrong, and the scale that was taken out."""
    part, aligned, tolerance = state.part, state.aligned, state.tolerance
    points = aligned.points[:: max(1, len(aligned.points) // MEASURED)]
    distance, _ = signed_distance(points, part)
    found = measure_fit(part, points, distance, aligned.noise, tolerance, state.unit, None)
    if found is None or found.form is None or found.fit.model != "scaled":
        return state, 1.0
    scale, form = found.fit.scale, found.form
    # x = s R' p, undone by T and then by the scale about the frame's centre: a rigid motion of the scaled scan
    T = form.T @ state.pose.T_part_scan
    T[:3, 3] = (T[:3, 3] - form.frame.centre) / scale + form.frame.centre
    scan = _divide(state.scan, scale)
    pose = replace(state.pose, T_part_scan=_make_rigid(T))
    state = state.derive(JobState.scan, scan, JobState.scan, JobState.aligned)
    state = state.derive(JobState.pose, pose, JobState.pose, JobState.aligned)
    moved = form.undo(aligned.points)
    corrected = _divide(replace(aligned, points=moved * scale), scale)
    if aligned.viewpoints is not None:
        corrected = replace(corrected, viewpoints=form.undo(aligned.viewpoints))
    return state.derive(JobState.aligned, corrected, JobState.scan, JobState.pose), scale


def _divide(scan: Scan, scale: float) -> Scan:
    viewpoints = None if scan.viewpoints is None else scan.viewpoints / scale
    return replace(
        scan, points=scan.points / scale, viewpoints=viewpoints, noise=scan.noise / scale, spacing=scan.spacing / scale
    )


def _make_rigid(T: Floats) -> Floats:
    u, _, v = np.linalg.svd(T[:3, :3])
    out = T.copy()
    out[:3, :3] = u @ v
    return out


def fit_model(engine: Engine, work: Work) -> Work:
    """Measures how well the part as designed explains the intact skin, and warns where it does not."""
    state = work.job
    aligned, deviation = state.aligned, state.deviation
    found = measure_fit(
        state.part, aligned.points, deviation.distance, aligned.noise, state.tolerance, state.unit, state.views,
        state.corrected_scale,
    )  # fmt: skip
    sources = (JobState.part, JobState.aligned, JobState.deviation, JobState.tolerance, JobState.views)
    found = _tell_adapted(found, state)
    state = state.derive(JobState.fitted, found, *sources)
    told = found is not None and (found.fit.model != "ok" or found.fit.corrected_scale != 1)
    if found is not None and told:
        warning = Reason("model_fit", found.fit.words, amount=found.fit.amount, unit=state.unit)
        work = replace(work, warnings=(*work.warnings, warning))
    return replace(work, job=state)


@overload
def _tell_adapted(fitted: FittedModel, state: JobState) -> FittedModel: ...
@overload
def _tell_adapted(fitted: None, state: JobState) -> None: ...
def _tell_adapted(fitted: FittedModel | None, state: JobState) -> FittedModel | None:
    """The fit in words that do not call an adapted part the part as designed."""
    if fitted is None or state.adapted is None:
        return fitted
    words = fitted.fit.words.replace("the part as designed", "the adapted part")
    return replace(fitted, fit=replace(fitted.fit, words=words))


def question_fit(engine: Engine, work: Work) -> Work:
    """Withdraws the statement that the part as designed explains the intact skin, where there are doubts."""
    state = work.job
    if state.fitted is None or state.fitted.fit.model != "ok":
        return work
    clusters = {number for item in state.surplus if item.kind == "displaced piece" for number in item.clusters}
    displaced = frozenset(site.number for site in work.sites if clusters & set(site.clusters))
    verdicts = {site.number: site.verdict for site in work.sites}
    doubts = find_fit_doubts(state.pose, verdicts, state.surplus, displaced, state.aligned, state.deviation, state.skin)
    if not doubts:
        return work
    before = state.fitted.fit
    fit = describe_fit(replace(before, model="open"), state.unit, state.tolerance, doubts)
    fit = _tell_adapted(replace(state.fitted, fit=fit), state).fit
    key = digest("questioned", state.key("fitted"), doubts)
    state = state.with_value(JobState.fitted, replace(state.fitted, fit=fit), key)
    # a corrected scale was reported in a note whose text is no longer true
    warnings = tuple(note for note in work.warnings if note.code != "model_fit")
    return replace(work, job=state, warnings=(*warnings, Reason("model_fit", fit.words)))


def measure_at_site(state: JobState, site: FoundSite) -> float:
    """How far intact skin deviates at a site by the model that the fit names; 0 where the part is as designed."""
    members = site.members
    if state.fitted is None or state.fitted.fit.model == "ok" or not len(members):
        return 0.0
    normals = state.part.face_normals[state.deviation.face[members]]
    places = state.aligned.points[members] - state.deviation.distance[members, None] * normals
    return measure_local(state.fitted, places, normals)


def measure_local(fitted: FittedModel, places: Floats, normals: Floats) -> float:
    """How far intact skin deviates at places on the skin (N,3) by the model that the fit names."""
    fit = fitted.fit
    by_form = float(np.quantile(np.abs(fitted.predict(places, normals)), 0.9))
    by_waves = 2 * fit.waviness if fit.model == "wavy" else 0.0
    apart = [view.apart for view in fit.views if not view.is_corrected]
    by_views = max(apart, default=0.0) if fit.model == "views disagree" else 0.0
    return max(by_form, by_waves, by_views)
