"""The step that finds the pose, also that of a part that is no longer as designed."""

from __future__ import annotations

from contextlib import suppress

from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.noise import AUTO_TOLERANCE
from damageest.geometry.transforms import move_points
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.placing.prepare import describe_columns
from damageest.pipeline.placing.shared_table import refit_without_table
from damageest.pipeline.state import JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules.notes import make_notes
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.trust.scan_quality import raise_tolerance, require_above_noise, require_tolerance, require_walls

COARSE = 4.0
"""How many tolerances a deformed part may lie off the part as designed, for its pose to be found."""
NO_NOISE, FAR_MORE = 1e-4, 3.0
"""Noise in spacings up to which a scan shows none, as one whose points lie on facets; and by how many times the
tolerance has to become larger for the pose to be found again."""
MEASURED = 20_000
"""Points, about, that the noise is measured with in the pose."""


@step(
    gives=("scan", "part", "pose", "refusal", "warnings"),
    reads=("adapter", "aligner", "tolerance", "asked_tolerance", "part", "scan"),
    calls=(Align,),
)
def align_scan(engine: Engine, state: JobState) -> tuple[Scan, Part, Pose, StageError | None, Reasons]:
    """Finds the pose, without a table where two scans show one that did not move along, and tells its notes."""
    pose, refusal = _find_pose(engine, state)
    scan, part = state.scan, state.part
    told: Reasons = ()
    if part.unseen is not None and state.aligner is not None and state.aligner.gives_fitted_pose:
        scan, part, pose, told = refit_without_table(engine, state, pose)
    return scan, part, pose, refusal, (*told, *make_notes(Align.stage, pose.notes))


def _find_pose(engine: Engine, state: JobState) -> tuple[Pose, StageError | None]:
    """Calls `align`. Where it refuses, and stage `adapt` may deform the part, it is called with a larger tolerance: too
    little of a deformed part lies on the part as designed. The refusal is then kept, and holds unless the adapted part
    explains the scan. Raises InputError for a tolerance that is less than the noise, or more than the part is thick."""
    if state.asked_tolerance is not None:
        require_walls(state.tolerance, state.part)
        if state.scan.noise > state.tolerance:
            require_above_noise(state.tolerance, state.scan, state.part)
            check_noise(engine, state)
    try:
        pose: Pose = engine.call(Align, state).get(Align.gives)
        return _align_again(engine, state, pose), None
    except StageError as refusal:
        refusal.message += describe_columns(state.scan)
        if Adapt in engine.job.given or state.adapter is None or not state.adapter.deforms:
            raise
        coarse = state.with_named("tolerance", COARSE * state.tolerance, state.key("tolerance") + " coarse")
        try:
            pose = engine.call(Align, coarse).get(Align.gives)
        except StageError:
            raise refusal from None
        return pose, refusal


def _align_again(engine: Engine, state: JobState, pose: Pose) -> Pose:
    """The pose in the tolerance that `auto` is raised to, where the noise of the scan says nothing: a scan that was
    meshed by the scanner's software has none, and its first tolerance is far too small to tell wear from form."""
    if state.asked_tolerance is not None or state.scan.noise > NO_NOISE * state.scan.spacing:
        return pose
    points = move_points(state.scan.points[:: max(1, len(state.scan.points) // MEASURED)], pose.T_part_scan)
    needed, _ = raise_tolerance(state.tolerance, signed_distance(points, state.part)[0], state.part, state.scan.noise)
    if needed < FAR_MORE * state.tolerance:
        return pose
    with suppress(StageError):
        raised = state.with_named("tolerance", needed, state.key("tolerance") + " raised")
        pose = engine.call(Align, raised).get(Align.gives)
    return pose


def check_noise(engine: Engine, state: JobState) -> None:
    """Raises InputError where the points scatter about the part by more than the tolerance. In such a tolerance no pose
    is found, or all of the skin is damaged.

    The noise as it was measured without a pose is too large where the skin curves within a few gaps. So the scatter is
    measured in the pose that is found with a tolerance for that noise; where none is, nothing is decided here.
    """
    wide = AUTO_TOLERANCE * state.scan.noise
    with suppress(StageError):
        pose: Pose = engine.call(Align, state.with_named("tolerance", wide, digest(wide))).get(Align.gives)
        points = move_points(state.scan.points[:: max(1, len(state.scan.points) // MEASURED)], pose.T_part_scan)
        require_tolerance(state.tolerance, signed_distance(points, state.part)[0], state.part, state.scan.noise)
