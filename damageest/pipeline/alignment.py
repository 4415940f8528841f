"""The step that finds the pose, also that of a part that is no longer as designed."""

from __future__ import annotations

from damageest.artefacts import Pose
from damageest.errors import StageError
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import JobState
from damageest.pipeline.steps import step
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align

COARSE = 4.0
"""How many tolerances a deformed part may lie off the part as designed, for its pose to be found."""


@step(gives=("pose", "refusal"), reads=("adapter", "tolerance"), calls=(Align,))
def align_scan(engine: Engine, state: JobState) -> tuple[Pose, StageError | None]:
    """Calls `align`. Where it refuses, and stage `adapt` may deform the part, it is called with a larger tolerance: too
    little of a deformed part lies on the part as designed. The refusal is then kept, and holds unless the adapted part
    explains the scan."""
    try:
        pose: Pose = engine.call(Align, state).get(Align.gives)
        return pose, None
    except StageError as refusal:
        if Adapt in engine.job.given or state.adapter is None or not state.adapter.deforms:
            raise
        coarse = state.with_named("tolerance", COARSE * state.tolerance, state.key("tolerance") + " coarse")
        try:
            pose = engine.call(Align, coarse).get(Align.gives)
        except StageError:
            raise refusal from None
        return pose, refusal
