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
from damageest.rules.two_sheets import OF_SCAN

HIDES = 1.2
"""How many times larger than the tolerance the least depth that can be seen has to be, for shallower sites that are
doubtful to be no sites."""
BEYOND = 1.645
"""How many standard deviations of the errors a site has to be deeper than a tolerance `auto`, for the same."""
CAUSES = ("shallow", "views", "stray")
"""What explains a site that is no loss: too shallow for the sensor, in views that lie apart, a few stray points."""
UNSUPPORTED = {"intact_over", "intact_inside", "beyond_points", "off_boundary", "scattered"}
"""Reasons against a volume of a few points, one of which says, with their number, that they bound none."""


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
    reads=(
        "found", "sensor", "facts", "aligner", "accept", "aligned", "deviation", "tolerance", "asked_tolerance", "unit"
    ),
)  # fmt: skip
def fold_hidden(state: JobState) -> tuple[tuple[FoundSite, ...], float, Reasons]:
    """Takes doubtful sites that errors of the sensor, views that lie apart or a few stray points explain for what they
    are. How much they hold at most stays in the interval of the total. Sites that the job accepts by number stay."""
    found, accept, unit = state.found, state.accept, state.unit
    # the error of a given pose is not the sensor's
    if getattr(state.aligner, "use", "none") == "none" or not isinstance(accept, str) or accept == "all":
        return found, 0.0, ()
    causes = {site.number: cause for site in found if (cause := _explain(state, site))}
    if not causes:
        return found, 0.0, ()
    explained = [site for site in found if site.number in causes]
    volume = sum(_limit_explained(state, site) for site in explained)
    deepest = max(site.measure_depth(state.deviation) for site in explained)
    many = f"{len(causes)} places are" if len(causes) > 1 else "1 place is"
    words = "; ".join(_describe_cause(state, cause) for cause in CAUSES if cause in causes.values())
    text = (
        f"{many} below the skin by up to {deepest:.3g} {unit}, which errors of this scan explain: {words}; they are no "
        f"sites, and their {volume:.4g} {unit}³ are in the high end of the total"
    )
    remedy = {
        "shallow": f"tolerance: {_choose_limit(state):.2g}, or a scan with smaller errors",
        "views": "register the views to each other again",
        "stray": "scan these places more densely",
    }
    kept = tuple(site for site in found if site.number not in causes)
    first = next(cause for cause in CAUSES if cause in causes.values())
    return kept, volume, [Reason("below_noise", text, amount=volume, unit=f"{unit}³", remedy=remedy[first])]


def _choose_limit(state: JobState) -> float:
    """Depth up to which errors of the sensor explain a site; 0 where they explain none.

    A tolerance that the job gives says what is looked for: unless the sensor shows far less, its sites stay. Where it
    is `auto`, a site has to be deeper than the tolerance by what its points scatter."""
    sensor, tolerance = state.sensor, state.tolerance
    if state.asked_tolerance is None:
        return max(sensor.least_depth, tolerance + BEYOND * float(np.hypot(sensor.noise, sensor.correlated)))
    return sensor.least_depth if sensor.least_depth >= HIDES * tolerance else 0.0


def _explain(state: JobState, site: FoundSite) -> str:
    """What explains a doubtful site that is no loss, one of `CAUSES`; empty where it may be one."""
    depth = site.measure_depth(state.deviation)
    if site.verdict.level != "doubtful" or not depth:
        return ""
    against = {reason.code for reason in site.verdict.reasons if reason.effect == "contradicts"}
    if depth < _choose_limit(state):
        return "shallow"
    if against & {"two_sheets", "misplaced_view"} and state.facts.sheets_share > OF_SCAN:
        return "views"
    return "stray" if "few_points" in against and against & UNSUPPORTED else ""


def _limit_explained(state: JobState, site: FoundSite) -> float:
    """How much an explained site may hold at most: no more than its points show, on the skin that they cover."""
    area = 2 * len(site.members) * (state.aligned.spacing / 1.1) ** 2  # twice: of its rim as well
    return min(limit_doubtful(site), area * site.measure_depth(state.deviation))


def _describe_cause(state: JobState, cause: str) -> str:
    unit, sensor, facts = state.unit, state.sensor, state.facts
    if cause == "shallow":
        return (
            f"its points deviate by {np.hypot(sensor.noise, sensor.correlated):.3g} {unit} on intact skin, so that "
            f"losses below {_choose_limit(state):.3g} {unit} cannot be seen in it"
        )
    if cause == "views":
        return f"at {facts.sheets_share:.1%} of its points it shows two surfaces, {facts.sheets_apart:.3g} {unit} apart"
    return "so few points lie on them, among intact ones, that they may be stray"
