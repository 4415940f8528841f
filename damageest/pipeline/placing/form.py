"""Steps about parts and scans that one rigid pose does not explain: they are measured, named and, on request, put
right."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import overload

import numpy as np

from damageest.artefacts import AdaptedPart, Flags, Floats, Ints, Pose, Reason, Scan
from damageest.errors import StageError
from damageest.findings import Surplus
from damageest.geometry.distance import signed_distance
from damageest.geometry.neighbourhoods import find_nearby
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.scan_field import ScanField
from damageest.geometry.transforms import invert_pose
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.placing.adapt import drop_settled, fit_pose
from damageest.pipeline.placing.datums import describe_moved, has_datums
from damageest.pipeline.registration import Registration
from damageest.pipeline.state import JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules.notes import make_notes
from damageest.stages.align import Align
from damageest.stages.scan import ReadScan
from damageest.trust.fit_doubts import find_fit_doubts
from damageest.trust.form.form_words import describe_fit, describe_view_of
from damageest.trust.model_fit import AskedFit, FittedModel, measure_fit
from damageest.trust.scan_quality import choose_tolerance
from damageest.trust.views.view_fit import ViewFits, fit_views
from damageest.trust.views.view_split import separate_views

MEASURED = 40_000
"""Points, about, that the scale is measured with before it is corrected."""

REMEDIES = {
    "deformed": "take adapt: auto, or look at the part",
    "views disagree": "check their overlap in the report, or register the views again",
    "wavy": "take a tolerance above the waviness, or a better scan",
}
"""What to do about a fit that is not as designed; the words of the others have it."""


@step(
    gives=("registration", "views"),
    reads=("registration", "asked_tolerance", "aligner", "unit"),
    calls=(Align,),
)
def correct_views(engine: Engine, state: JobState) -> tuple[Registration, ViewFits | None]:
    """Compares the views, also those that only the points tell apart, and puts misplaced ones right where the alignment
    fits views: noise, spacing and a tolerance `auto` are then measured again, the pose is fitted to the job's datums
    again, and that little of the scan lay on the part is no doubt any more."""
    here = state.registration
    part, aligned, tolerance = here.part, here.aligned, here.tolerance
    label, found_by = separate_views(part, aligned, tolerance) or (None, "given")
    moves_views = state.aligner is not None and state.aligner.moves_views
    views = fit_views(part, aligned, tolerance, moves_views, label, found_by)
    if label is not None:
        if views is None or not views.disagree:
            return here, None
        here = replace(here, aligned=replace(aligned, cloud=label.astype(np.int32)))
    if views is None or not any(view.is_corrected for view in views.views):
        return here, views
    aligned = views.apply(here.aligned)
    pose, _ = fit_pose(here.pose, views.common, aligned.points, part, tolerance)
    pose = replace(pose, T_part_scan=_make_rigid(pose.T_part_scan))
    noise, spacing = measure_noise_and_spacing(aligned.points)
    aligned = replace(aligned, noise=noise, spacing=spacing)
    if state.asked_tolerance is None:
        tolerance = min(tolerance, choose_tolerance(None, aligned, part)[0])
    warnings = drop_settled(here.warnings, here.pose, pose)
    here = replace(here, pose=pose, aligned=aligned, tolerance=tolerance, warnings=warnings)
    if has_datums(state.aligner):
        here = _hold_datums(engine, state, here, views)
    return here, views


def _hold_datums(engine: Engine, state: JobState, here: Registration, views: ViewFits) -> Registration:
    """The pose fitted to the job's datums again, after views were put right. Where that fails, it is told how far the
    views moved it."""
    corrected = here.aligned.move(invert_pose(here.pose))
    moved = state.with_value(JobState.scan, corrected, digest("corrected views", state.key("registration")))
    moved = moved.with_value(JobState.tolerance, here.tolerance)
    with suppress(StageError):
        again: Pose = engine.make_silent().call(Align, moved).get(Align.gives)
        settled = [note for note in here.warnings if note.code != "align"]
        aligned = corrected.move(again.T_part_scan)
        return replace(here, pose=again, aligned=aligned, warnings=[*settled, *make_notes("align", again.notes)])
    text = "after the correction of views the pose could not be fitted to the datums"
    note = describe_moved(here.part, views.common, here.tolerance, state.unit, text, "fit_views: false of align")
    return replace(here, warnings=[*here.warnings, *note])


@step(gives=("registration", "corrected_scale"))
def correct_scale(
    registration: Registration, unit: str, reader: ReadScan | None, scan_centre: Floats
) -> tuple[Registration, float]:
    """Corrects the scan's scale where it is wrong and the job says so, and gives the scale that was taken out."""
    if reader is None or not reader.finds_scale:
        return registration, 1.0
    part, aligned, pose = registration.part, registration.aligned, registration.pose
    points = aligned.points[:: max(1, len(aligned.points) // MEASURED)]
    distance, _ = signed_distance(points, part)
    found = measure_fit(part, points, distance, aligned.noise, registration.tolerance, unit, None)
    if found is None or found.form is None or found.fit.model != "scaled":
        return registration, 1.0
    scale, form = found.fit.scale, found.form
    # x = s R' p, undone by T and then by the scale about the frame's centre: a rigid motion of the scaled scan
    T = form.T @ pose.T_part_scan
    T[:3, 3] = (T[:3, 3] - form.frame.centre) / scale + form.frame.centre
    T = _make_rigid(T)
    T[:3, 3] -= (1 - 1 / scale) * T[:3, :3] @ scan_centre  # which stays where it is
    moved = form.undo(aligned.points)
    corrected = divide_scan(replace(aligned, points=moved * scale), scale, np.zeros(3))
    if aligned.viewpoints is not None:
        corrected = replace(corrected, viewpoints=form.undo(aligned.viewpoints))
    scan = divide_scan(registration.scan, scale, scan_centre)
    return replace(registration, scan=scan, pose=replace(pose, T_part_scan=T), aligned=corrected), scale


def divide_scan(scan: Scan, scale: float, centre: Floats) -> Scan:
    """The scan with all of its lengths divided by a scale, about a place (3,) of its frame, which stays."""

    def divide(places: Floats) -> Floats:
        return np.asarray(centre + (places - centre) / scale)

    viewpoints = None if scan.viewpoints is None else divide(scan.viewpoints)
    return replace(
        scan, points=divide(scan.points), viewpoints=viewpoints, noise=scan.noise / scale, spacing=scan.spacing / scale
    )


def _make_rigid(T: Floats) -> Floats:
    u, _, v = np.linalg.svd(T[:3, :3])
    out = T.copy()
    out[:3, :3] = u @ v
    return out


@step(gives=("fitted", "warnings"))
def fit_model(
    field: ScanField, adapted: AdaptedPart | None, surplus: tuple[Surplus, ...], unit: str, views: ViewFits | None,
    corrected_scale: float, asked_fit: AskedFit | None,
) -> tuple[FittedModel | None, Reasons]:  # fmt: skip
    """Measures how well the part as designed explains the intact skin, and warns where it does not. Surroundings are
    left out: a table ends at the part's lower edges as skin that is bent away does."""
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    own = _leave_surroundings_out(aligned, surplus, tolerance)
    if asked_fit is not None and own.all() and (asked_fit.tolerance, asked_fit.noise) == (tolerance, aligned.noise):
        found = asked_fit.fitted  # measured before, with the same part in the same pose
        if found is not None:
            fit = replace(found.fit, corrected_scale=corrected_scale)
            found = replace(found, fit=describe_fit(fit, unit, tolerance))
    else:
        found = measure_fit(
            part, aligned.points[own], field.distance[own], aligned.noise, tolerance, unit, views, corrected_scale
        )
    found = _note_adapted(found, adapted)
    told = found is not None and (found.fit.model != "ok" or found.fit.corrected_scale != 1)
    if found is not None and told:
        remedy = REMEDIES.get(found.fit.model, "")
        return found, [Reason("model_fit", found.fit.words, amount=found.fit.amount, unit=unit, remedy=remedy)]
    return found, ()


def _leave_surroundings_out(aligned: Scan, surplus: tuple[Surplus, ...], tolerance: float) -> Flags:
    """Which points (N,) are neither surroundings nor beside them, where the skin cannot be told from them."""
    own = np.ones(len(aligned.points), bool)
    outside = [item.points for item in surplus if item.kind == "surroundings"]
    if outside:
        own[np.concatenate(outside)] = False
        near = find_nearby(aligned.points, aligned.points[~own], 2 * tolerance + aligned.spacing)
        own[near] = False
    return own


@overload
def _note_adapted(fitted: FittedModel, adapted: AdaptedPart | None) -> FittedModel: ...
@overload
def _note_adapted(fitted: None, adapted: AdaptedPart | None) -> None: ...
def _note_adapted(fitted: FittedModel | None, adapted: AdaptedPart | None) -> FittedModel | None:
    """The fit in words that do not call an adapted part the part as designed."""
    if fitted is None or adapted is None:
        return fitted
    words = fitted.fit.words.replace("the part as designed", "the adapted part")
    return replace(fitted, fit=replace(fitted.fit, words=words))


@step(
    gives=("fitted", "warnings"),
    reads=("fitted", "surplus", "found", "pose", "field", "adapted", "skin", "unit", "explained", "warnings"),
)
def review_model_fit(
    state: JobState,
) -> tuple[FittedModel | None, Reasons]:
    """Withdraws the statement that the part as designed explains the intact skin, where there are doubts; limits it to
    what was seen, where that is little."""
    fitted, warnings, adapted, unit, found = state.fitted, state.warnings, state.adapted, state.unit, state.found
    if fitted is None or fitted.fit.model != "ok":
        return fitted, warnings
    field, skin = state.field, state.skin
    clusters = {number for item in state.surplus if item.kind == "displaced piece" for number in item.clusters}
    displaced = frozenset(site.number for site in found if clusters & set(site.clusters))
    verdicts = {site.number: site.verdict for site in found}
    doubts = find_fit_doubts(state.pose, verdicts, state.surplus, displaced, field, skin)
    if state.explained.places:
        doubts += ("views lie apart",)
    if not doubts:
        seen = float(skin.cells.areas[skin.perhaps_seen].sum() / skin.cells.areas.sum())
        partly = describe_view_of(fitted.fit, seen, field.part.diagonal, unit, field.tolerance)
        fit = describe_fit(fitted.fit, unit, field.tolerance, partly=partly)
        return _note_adapted(replace(fitted, fit=fit), adapted), warnings
    fit = describe_fit(replace(fitted.fit, model="open"), unit, field.tolerance, doubts)
    fit = _note_adapted(replace(fitted, fit=fit), adapted).fit
    # a corrected scale was reported in a note whose text is no longer true
    kept = [note for note in warnings if note.code != "model_fit"]
    remedy = "look at the report: colour the scan by distance"
    return replace(fitted, fit=fit), [*kept, Reason("model_fit", fit.words, remedy=remedy)]


def measure_at_site(fitted: FittedModel | None, field: ScanField, members: Ints) -> float:
    """How far intact skin deviates at the points ``members`` of a site by the model that the fit names; 0 where the
    part is as designed."""
    if fitted is None or fitted.fit.model == "ok" or not len(members):
        return 0.0
    return measure_local(fitted, field.find_feet(members), field.find_normals(members))


def measure_local(fitted: FittedModel, places: Floats, normals: Floats) -> float:
    """How far intact skin deviates at places on the skin (N,3) by the model that the fit names."""
    fit = fitted.fit
    by_form = float(np.quantile(np.abs(fitted.predict(places, normals)), 0.9))
    by_waves = 2 * fit.waviness if fit.model == "wavy" else 0.0
    is_corrected = any(view.is_corrected for view in fit.views)
    apart = [view.left if is_corrected else view.apart for view in fit.views]
    by_views = max(apart, default=0.0) if fit.model == "views disagree" else 0.0
    return max(by_form, by_waves, by_views)
