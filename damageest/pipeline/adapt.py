"""The step that puts the adapted part in the place of the part as designed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Part, Pose
from damageest.checks.model_fit import measure_fit
from damageest.geometry.distance import signed_distance
from damageest.geometry.transforms import move_points
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Step
from damageest.pipeline.state import JobState, Work
from damageest.registry.contracts import Contract
from damageest.rules.notes import make_notes
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.sample import Sample

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
BY_FORM = "another_part"
"""Code of the doubt in a pose that a part of another form explains."""


def adapt_part(adapt: Contract) -> Step:
    """A step that calls the contract, unless the job takes the part as designed, and goes on with what it gives."""

    def run(engine: Engine, work: Work) -> Work:
        stage = engine.job.stages[adapt]
        if adapt not in engine.job.given and isinstance(stage, Adapt) and not stage.deforms:
            return keep_designed(work)
        if isinstance(stage, Adapt) and stage.asks_first and not is_asked_for(work.job):
            return keep_designed(work)
        return take_adapted(engine, replace(work, job=engine.call(adapt, work.job)))

    return run


def keep_designed(work: Work) -> Work:
    """The work with the part as designed."""
    return replace(work, job=work.job.with_value(JobState.adapted, None, digest("as designed")))


def is_asked_for(state: JobState) -> bool:
    """Whether the intact skin shows a part that is not as designed: a form that the fit of the model names, or a scan
    of which too little lies on the part in the best pose."""
    if any(doubt.code == BY_FORM for doubt in state.pose.doubts):
        return True
    points = state.aligned.points[:: max(1, len(state.aligned.points) // MEASURED)]
    distance, _ = signed_distance(points, state.part)
    found = measure_fit(state.part, points, distance, state.aligned.noise, state.tolerance, state.unit, state.views)
    return found is not None and found.fit.model in ASKING


def take_adapted(engine: Engine, work: Work) -> Work:
    """The work with the adapted part as its part, the scan and its pose moved onto it, and samples on its skin."""
    state = work.job
    adapted = state.adapted
    if adapted is None:
        return work
    aligned = state.aligned.move(adapted.motion)
    pose = fit_pose(state.pose, adapted.motion, aligned.points, adapted.part, state.tolerance)
    before, sources = state, (JobState.pose, JobState.adapted, JobState.tolerance)
    state = state.derive(JobState.aligned, aligned, JobState.aligned, JobState.adapted)
    state = state.derive(JobState.part, adapted.part, JobState.part, JobState.adapted)
    if pose.doubts or pose.free:
        pose = doubt_anew(pose, engine.make_silent().call(Align, state).pose, aligned.points, state.tolerance)
    state = state.derive(JobState.pose, pose, *sources)
    settled = {f"{doubt}" for doubt in before.pose.doubts} - {f"{doubt}" for doubt in pose.doubts}
    warnings = tuple(note for note in work.warnings if note.code != "align" or note.text not in settled)
    state = engine.make_silent().call(Sample, state)
    return replace(work, job=state, warnings=(*warnings, *make_notes("adapt", adapted.notes)))


def doubt_anew(pose: Pose, again: Pose, points: Floats, tolerance: float) -> Pose:
    """The pose of the aligned ``points`` (N,3) with the doubts and free motions that an alignment to the adapted part
    has, where that agrees. Those of the part as designed may come from its form: it fits nowhere, so it fits as well
    moved a little."""
    moved = move_points(points[:: max(1, len(points) // ASKED)], again.T_part_scan @ np.linalg.inv(pose.T_part_scan))
    off = float(np.linalg.norm(moved - points[:: max(1, len(points) // ASKED)], axis=1).max(initial=0.0))
    if off > tolerance:
        return pose
    return replace(pose, doubts=again.doubts, free=again.free, notes=again.notes, is_held=again.is_held)


def fit_pose(pose: Pose, motion: Floats, points: Floats, part: Part, tolerance: float) -> Pose:
    """The pose of the aligned ``points`` (N,3) on the adapted part. That little of the scan lay on the part as designed
    is no doubt where it lies on the adapted part."""
    distance, _ = signed_distance(points[:: max(1, len(points) // ASKED)], part)
    on = np.abs(distance) <= tolerance
    near = max(int((distance < NEAR * part.diagonal).sum()), 1)
    doubts, notes = pose.doubts, pose.notes
    if on.sum() >= AGREES * near:
        doubts = tuple(doubt for doubt in doubts if doubt.code != BY_FORM)
        settled = {f"{doubt}" for doubt in pose.doubts} - {f"{doubt}" for doubt in doubts}
        notes = tuple(note for note in notes if note not in settled)
    rms = float(np.sqrt((distance[on] ** 2).mean())) if on.any() else pose.rms
    return replace(
        pose, T_part_scan=motion @ pose.T_part_scan, rms=rms, inliers=float(on.mean()), doubts=doubts, notes=notes
    )
