"""Steps about the errors of the sensor: how large they are, and which sites they explain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import DAMAGE, OUTLIER, Ints, Pose, Reason, Sites
from damageest.findings import Explained, Sensor
from damageest.geometry.scan_field import ScanField
from damageest.job.model import Accept
from damageest.pipeline.judging.uncertainty import limit_doubtful
from damageest.pipeline.placing.datums import choose_on_datums
from damageest.pipeline.state import FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules import ScanFacts
from damageest.stages.align import Align
from damageest.trust.doubts.misplaced_view import AGAINST
from damageest.trust.interval.pose_error import PoseError, measure_pose_error
from damageest.trust.interval.semivariogram import measure_semivariogram
from damageest.trust.interval.sensor import NEEDED, describe_sensor, measure_levels, measure_shown
from damageest.trust.views.two_sheets import EXPLAINED, measure_two_sheets

HIDES = 1.2
"""How many times larger than the tolerance the least depth that can be seen has to be, for shallower sites that are
doubtful to be no sites."""
BEYOND = 1.645
"""How many standard deviations of the errors a site has to be deeper than a tolerance `auto`, for the same."""
DEEPEST = 0.95
"""Share of the points of a cluster above the depth that has to be within what views apart explain. As many points
deeper than that as a site needs may be a loss, in however large a cluster."""
CAUSES = ("shallow", "views", "stray")
"""What explains a site that is no loss: too shallow for the sensor, in views that lie apart, a few stray points."""
UNSUPPORTED = {"intact_over", "intact_inside", "beyond_points", "off_boundary", "scattered"}
"""Reasons against a volume of a few points, one of which says, with their number, that they bound none."""


def measure_sensor(
    field: ScanField, sites: Sites, facts: ScanFacts, explained: Explained, depth_step: float, pose: Pose,
    aligner: Align | None,
) -> tuple[PoseError, Sensor]:  # fmt: skip
    """Measures noise and systematic errors of the intact skin, and what they hide."""
    fixing = choose_on_datums(aligner, field.part, field.feet, field.deviation.face)
    error = measure_pose_error(field, spread=pose.spread, held=is_given(aligner), fixing=fixing)
    stray = (field.label == OUTLIER) | ((field.label == DAMAGE) & (sites.label == 0))
    share = (int(stray.sum()) - explained.points) / max(len(stray), 1)
    sensor = describe_sensor(
        measure_levels(field), field.aligned, error, facts.systematic, depth_step, field.tolerance, share,
        measure_semivariogram(field),
    )  # fmt: skip
    return error, sensor


@step(
    gives=("sites", "explained"),
    reads=("field", "sites", "sheets", "views", "aligner", "accept"),
)
def dismiss_explained_clusters(state: JobState) -> tuple[Sites, Explained]:
    """Takes clusters of points that views which lie apart explain for no sites: their verdict would be doubtful,
    whatever their volume is. What is deeper than the views explain stays, and what the job accepts by number."""
    field, sites, views, sheets = state.field, state.sites, state.views, state.sheets
    is_apart = sheets.disagree or (views is not None and views.disagree)
    if not is_apart or not _is_folding(state.aligner, state.accept):
        return sites, Explained()
    apart = max([sheets.apart, *(one.apart for one in (views.views if views else ()))])
    gone = []
    for number in range(1, sites.count + 1):
        members = sites.members(number)
        depth = -field.distance[members]
        most = EXPLAINED * apart
        if not len(depth) or np.quantile(depth, DEEPEST) > most or np.count_nonzero(depth > most) >= NEEDED:
            continue
        own = measure_two_sheets(field, members)
        if sheets.explain(own, float(np.median(depth))) or (
            views is not None and views.find_explained(field, members) > AGAINST
        ):
            gone.append(number)
    if not gone:
        return sites, Explained()
    members = np.flatnonzero(np.isin(sites.label, gone))
    deepest = float(-field.distance[members].min())
    volume = sum(limit_shown(field, sites.members(number)) for number in gone)
    new = np.zeros(sites.count + 1, np.int32)
    kept = np.setdiff1d(np.arange(1, sites.count + 1), gone)
    new[kept] = np.arange(1, len(kept) + 1)
    explained = Explained(len(gone), len(members), volume, deepest)
    return replace(sites, label=new[sites.label], count=len(kept)), explained


@step(
    gives=("found", "folded", "warnings"),
    reads=(
        "found", "sensor", "explained", "sheets", "aligner", "accept", "tolerance", "asked_tolerance", "unit", "field",
    ),
)  # fmt: skip
def dismiss_explained_sites(state: JobState) -> tuple[tuple[FoundSite, ...], float, Reasons]:
    """Takes doubtful sites that errors of the sensor or a few stray points explain for what they are, and names them
    with those that views apart explain. How much they hold at most stays in the interval of the total."""
    causes = {site.number: cause for site in state.found if (cause := _explain(state, site))}
    count = len(causes) + state.explained.places
    if not count:
        return state.found, 0.0, ()
    gone = [site for site in state.found if site.number in causes]
    volume = state.explained.volume + sum(_limit_explained(state, site, causes[site.number]) for site in gone)
    deepest = max([state.explained.deepest, *(site.measure_depth(state.field) for site in gone)])
    all_causes = {*causes.values(), *(("views",) if state.explained.places else ())}
    told = [_describe_cause(state, cause) for cause in CAUSES if cause in all_causes]
    many, unit = f"{count} places" if count > 1 else "1 place", state.unit
    text = (
        f"{many} up to {deepest:.3g} {unit} deep treated as errors of the scan, not as sites: "
        f"{'; '.join(words for words, _ in told)}; the high end of the total includes their {volume:.3g} {unit}³"
    )
    kept = tuple(site for site in state.found if site.number not in causes)
    return kept, volume, [Reason("below_noise", text, amount=volume, unit=f"{unit}³", remedy=told[0][1])]


def limit_shown(field: ScanField, members: Ints) -> float:
    """How much scan points ``members`` (M,) show at most of a loss: the skin that they cover, and twice as much beside
    it, where it is shallower than the tolerance, times the largest depth."""
    area = 3 * measure_shown(field.aligned, len(members))
    return area * max(float(-field.distance[members].min(initial=0.0)), 0.0)


def _limit_explained(state: JobState, site: FoundSite, cause: str) -> float:
    """How much a site that is none holds at most. The volume of a few stray points is what bulges between them."""
    most = limit_doubtful(site)
    return min(most, limit_shown(state.field, site.members)) if cause == "stray" else most


def is_given(aligner: Align | None) -> bool:
    """Whether the job gives the pose, so that no error of the scan moves it."""
    return aligner is None or not aligner.gives_fitted_pose


def _is_folding(aligner: Align | None, accept: Accept) -> bool:
    """Whether sites that errors of the scan explain are set aside: not where the pose is given, whose error is not the
    sensor's, and not where the job accepts them."""
    return not is_given(aligner) and isinstance(accept, str) and accept != "all"


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
    if not _is_folding(state.aligner, state.accept) or site.verdict.level != "doubtful":
        return ""
    depth = site.measure_depth(state.field)
    if not depth:
        return ""
    against = {reason.code for reason in site.verdict.reasons if reason.effect == "contradicts"}
    if "few_points" in against and against & UNSUPPORTED:
        return "stray"
    return "shallow" if depth < _choose_limit(state) else ""


def _describe_cause(state: JobState, cause: str) -> tuple[str, str]:
    """Words for a cause, and its remedy."""
    unit, sensor, sheets = state.unit, state.sensor, state.sheets
    if cause == "shallow":
        limit = _choose_limit(state)
        return (
            f"intact points deviate by {np.hypot(sensor.noise, sensor.correlated):.3g} {unit}, so losses below "
            f"{limit:.3g} {unit} are invisible",
            f"take tolerance: {limit:.2g}, or a better scan",
        )
    if cause == "views":
        return (
            f"two surfaces {sheets.apart:.3g} {unit} apart at {sheets.share:.1%} of the points, like those of views "
            "that do not fit together",
            "register the views again, or give them as a list of files",
        )
    return "few points among intact ones", "scan these places more densely"
