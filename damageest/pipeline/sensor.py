"""Steps about the errors of the sensor: how large they are, and which sites they explain."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import DAMAGE, OUTLIER, Deviation, Part, Reason, Scan, Sites
from damageest.checks.pose_error import PoseError, measure_pose_error
from damageest.checks.sensor import describe_sensor, measure_levels
from damageest.findings import Sensor
from damageest.pipeline.state import FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.pipeline.uncertainty import limit_doubtful
from damageest.rules import ScanFacts

HIDES = 1.2
"""How many times larger than the tolerance the least depth that can be seen has to be, for shallower sites that are
doubtful to be no sites."""


@step(gives=("pose_error", "sensor"))
def measure_sensor(
    part: Part, aligned: Scan, deviation: Deviation, sites: Sites, facts: ScanFacts, depth_step: float, tolerance: float
) -> tuple[PoseError, Sensor]:
    """Measures noise and systematic errors of the intact skin, and what they hide."""
    pose = measure_pose_error(part, aligned, deviation, tolerance)
    levels = measure_levels(part, aligned, deviation)
    stray = (deviation.label == OUTLIER) | ((deviation.label == DAMAGE) & (sites.label == 0))
    share = float(stray.mean()) if len(stray) else 0.0
    sensor = describe_sensor(levels, aligned, pose, facts.systematic, depth_step, tolerance, share)
    return pose, sensor


@step(
    gives=("found", "folded", "warnings"),
    reads=("found", "sensor", "aligner", "accept", "deviation", "tolerance", "unit"),
)
def fold_hidden(state: JobState) -> tuple[tuple[FoundSite, ...], float, Reasons]:
    """Takes doubtful sites that are shallower than what the scan can show for what they are: errors of the sensor. How
    much they hold at most stays in the interval of the total. Sites that the job accepts by number stay."""
    found, sensor, accept, unit = state.found, state.sensor, state.accept, state.unit
    is_given = getattr(state.aligner, "use", "none") == "none"  # its error is not the sensor's
    if is_given or sensor.least_depth < HIDES * state.tolerance or not isinstance(accept, str) or accept == "all":
        return found, 0.0, ()
    depths = {
        site.number: depth
        for site in found
        if site.verdict.level == "doubtful" and 0 < (depth := site.measure_depth(state.deviation)) < sensor.least_depth
    }
    if not depths:
        return found, 0.0, ()
    kept = tuple(site for site in found if site.number not in depths)
    volume = sum(limit_doubtful(site) for site in found if site.number in depths)
    deepest = max(depths.values())
    many = f"{len(depths)} places are" if len(depths) > 1 else "1 place is"
    text = (
        f"{many} below the skin by up to {deepest:.3g} {unit}, which errors of this scan explain: its points deviate "
        f"by {np.hypot(sensor.noise, sensor.correlated):.3g} {unit} on intact skin, so that losses below "
        f"{sensor.least_depth:.3g} {unit} cannot be seen in it; they are no sites, and their {volume:.4g} {unit}³ are "
        "in the high end of the total"
    )
    remedy = f"tolerance: {sensor.least_depth:.2g}, or a scan with smaller errors"
    return kept, volume, [Reason("below_noise", text, amount=volume, unit=f"{unit}³", remedy=remedy)]
