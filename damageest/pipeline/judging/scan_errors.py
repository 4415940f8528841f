"""The step that measures the errors that all sites of a scan have in common."""

from __future__ import annotations

from dataclasses import replace

from damageest.findings import Sensor
from damageest.pipeline.judging.sensor import measure_sensor
from damageest.pipeline.judging.weigh import weigh_scanner
from damageest.pipeline.state import JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules import ScanFacts
from damageest.trust.interval.loss import ScanErrors
from damageest.trust.scan_facts import gather_scan_facts


@step(
    gives=("errors", "sensor", "warnings"),
    reads=(
        "field", "skin", "surplus", "sheets", "pose", "aligner", "unit", "fitted", "adapted", "sites", "explained",
        "depth_step", "scanner", "temperature", "corrected_scale",
    ),
)  # fmt: skip
def measure_scan_errors(state: JobState) -> tuple[ScanErrors, Sensor, Reasons]:
    """Measures what the whole scan says about skin that deviates and is not damaged, noise and systematic errors of the
    intact skin, and what certificate and temperature say; warns where the scan contradicts these."""
    facts, field, fitted, aligner = _gather_facts(state), state.field, state.fitted, state.aligner
    pose, sensor = measure_sensor(field, state.sites, facts, state.explained, state.depth_step, state.pose, aligner)
    scanner, told = weigh_scanner(
        state.scanner, state.temperature, state.corrected_scale, fitted, field, pose, facts, state.unit
    )
    return ScanErrors(pose, facts, scanner), sensor, told


def _gather_facts(state: JobState) -> ScanFacts:
    aligner, pose = state.aligner, state.pose
    is_fitted = aligner is not None and aligner.gives_fitted_pose and not pose.is_held
    facts = gather_scan_facts(state.field, state.skin, state.surplus, state.sheets, pose, is_fitted, state.unit)
    fitted, adapted = state.fitted, state.adapted
    fit = None if fitted is None else fitted.fit
    return replace(facts, fit=fit, adapted=0.0 if adapted is None else adapted.amount)
