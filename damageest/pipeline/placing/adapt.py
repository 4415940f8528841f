"""The step that puts the adapted part in the place of the part as designed."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from damageest.artefacts import AdaptedPart, Floats, Part, Pose
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.geometry.transforms import move_points
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.placing.datums import note_datums
from damageest.pipeline.registration import Registration
from damageest.pipeline.state import JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules.notes import make_notes
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.trust.model_fit import AskedFit, measure_fit
from damageest.trust.views.two_sheets import measure_sheets

AGREES = 0.72
"""Share of the scan near the part that has to lie on the adapted skin, for it to show this part: as stage align asks
of a rigid part."""
NEAR = 0.05
"""Distance outside the part, in diagonals, from which a point shows something beside it."""
ASKED = 15_000
"""Points that the share is estimated from."""
MEASURED = 40_000
"""Points, about, that the form of the part is measured with before it is adapted."""
ASKING = ("deformed", "scaled", "wavy")
"""What the fit of the model calls a part that a field may explain."""
BEYOND_VIEWS = 2.0
"""How far the form has to move the skin, in a tenth of it, in distances of views that lie apart."""
BY_FORM = "another_part"
"""Code of the doubt in a pose that a part of another form explains."""


@step(
    gives=("registration", "adapted", "asked_fit"),
    reads=(
        "registration", "part", "aligned", "pose", "refusal", "tolerance", "unit", "views", "adapter",
        "aligner",
    ),
    calls=(Adapt, Align),
)  # fmt: skip
def adapt_part(engine: Engine, state: JobState) -> tuple[Registration, AdaptedPart | None, AskedFit | None]:
    """Calls `adapt`, unless the job takes the part as designed, and puts what it gives in the place of the part, with
    the scan and its pose moved onto it. Where the fit of the model was measured to ask whether the part is as designed,
    and the part stays so, it gives that too. Raises the refusal of stage `align` where the adapted part does not
    explain the scan either."""
    called, asked, failed = call_adapt(engine, state)
    here = state.registration
    if called is None or called.get(Adapt.gives) is None:
        if state.refusal is not None:
            raise state.refusal
        here = replace(here, warnings=(*here.warnings, *make_notes("adapt", failed))) if failed else here
        return here, None, asked
    adapted: AdaptedPart = called.get(Adapt.gives)
    key = called.key(Adapt.gives)
    aligned = state.aligned.move(adapted.motion)
    pose, is_shown = fit_pose(state.pose, adapted.motion, aligned.points, adapted.part, state.tolerance)
    if state.refusal is not None and not is_shown:
        raise state.refusal
    moved = state.with_value(JobState.aligned, aligned, digest("aligned", key))
    moved = moved.with_value(JobState.part, adapted.part, digest("part", key))
    own = engine.make_silent()
    if pose.doubts or pose.free:
        with suppress(StageError):  # a given pose, which the adapted part moves away from, keeps its doubts
            pose = recheck_pose(pose, own.call(Align, moved).get(Align.gives), aligned.points, state.tolerance)
    told = (*drop_settled(here.warnings, here.pose, pose), *make_notes("adapt", adapted.notes))
    told += tuple(note_datums(adapted, state.aligner, adapted.part, state.tolerance, state.unit))
    here = replace(here, part=adapted.part, aligned=aligned, pose=pose, warnings=told)
    return here, adapted, None


def drop_settled(warnings: Reasons, before: Pose, after: Pose) -> Reasons:
    """The warnings without those of doubts that the pose had before, and has no more."""
    settled = {f"{doubt}" for doubt in before.doubts} - {f"{doubt}" for doubt in after.doubts}
    return [note for note in warnings if note.code != "align" or note.text not in settled]


def call_adapt(engine: Engine, state: JobState) -> tuple[JobState | None, AskedFit | None, tuple[str, ...]]:
    """The state after `adapt`; None where it is not asked for, or fails where nobody asked for it by name, with a note
    of why. And the fit of the model, where it was measured to ask."""
    stage = state.adapter
    if Adapt in engine.job.given:
        return engine.call(Adapt, state), None, ()
    if stage is None or not stage.deforms:
        return None, None, ()
    asked = None
    if stage.asks_first and state.refusal is None and not any(doubt.code == BY_FORM for doubt in state.pose.doubts):
        asked, is_asked_for = find_deformation(state)
        if not is_asked_for:
            return None, asked, ()
    try:
        return engine.call(Adapt, state), asked, ()
    except StageError as error:
        if not stage.asks_first:
            raise
        return None, asked, (f"the part was not adapted: {error.message}; the result is that of the part as designed",)


def find_deformation(state: JobState) -> tuple[AskedFit, bool]:
    """The fit of the model, and whether the intact skin shows a part that is not as designed by a form that it names.
    Where views lie apart, a form has to be larger than that: a field would follow the views."""
    step = max(1, len(state.aligned.points) // MEASURED)
    some = state.aligned.take(np.arange(0, len(state.aligned.points), step))
    field = ScanField.measure(state.part, some, state.tolerance)
    found = measure_fit(state.part, some.points, field.distance, some.noise, state.tolerance, state.unit, state.views)
    asked = AskedFit(found, state.tolerance, some.noise)
    if found is None or found.fit.model not in ASKING:
        return asked, False
    sheets = measure_sheets(field)
    if not sheets.disagree or not len(some.points):
        return asked, True
    form = np.quantile(np.abs(found.predict(some.points, state.part.face_normals[field.deviation.face])), 0.9)
    return asked, bool(form > BEYOND_VIEWS * sheets.apart)


def recheck_pose(pose: Pose, again: Pose, points: Floats, tolerance: float) -> Pose:
    """The pose of the aligned ``points`` (N,3) with the doubts and free motions that an alignment to the adapted part
    has, where that agrees. Those of the part as designed may come from its form: it fits nowhere, so it fits as well
    moved a little."""
    some = points[:: max(1, len(points) // ASKED)]
    others = [] if again.alternatives is None else list(again.alternatives)  # of a symmetric part any may come first
    apart = [move_points(some, T @ np.linalg.inv(pose.T_part_scan)) - some for T in (again.T_part_scan, *others)]
    if min(float(np.linalg.norm(way, axis=1).max(initial=0.0)) for way in apart) > tolerance:
        return pose
    return replace(pose, doubts=again.doubts, free=again.free, notes=again.notes, is_held=again.is_held)


def fit_pose(pose: Pose, motion: Floats, points: Floats, part: Part, tolerance: float) -> tuple[Pose, bool]:
    """The pose of the aligned ``points`` (N,3) on the adapted part, or of corrected views, and whether they show that
    part. That little of the scan lay on the part as designed is then no doubt."""
    distance, _ = signed_distance(points[:: max(1, len(points) // ASKED)], part)
    on = np.abs(distance) <= tolerance
    near = max(int((distance < NEAR * part.diagonal).sum()), 1)
    doubts, notes = pose.doubts, pose.notes
    is_shown = bool(on.sum() >= AGREES * near)
    if is_shown:
        doubts = tuple(doubt for doubt in doubts if doubt.code != BY_FORM)
        settled = {f"{doubt}" for doubt in pose.doubts} - {f"{doubt}" for doubt in doubts}
        notes = tuple(note for note in notes if note not in settled)
    rms = float(np.sqrt((distance[on] ** 2).mean())) if on.any() else pose.rms
    moved = motion @ pose.T_part_scan
    return replace(pose, T_part_scan=moved, rms=rms, inliers=float(on.mean()), doubts=doubts, notes=notes), is_shown
