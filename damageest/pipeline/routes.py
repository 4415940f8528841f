"""The routes: which contracts are called in which order, and the steps between them.

A contract calls the implementation that the job names, once per job or once per site as the contract says. A step takes
all of the work and gives it changed; some steps call contracts themselves, and have them as arguments.
"""

from __future__ import annotations

from damageest.pipeline.adapt import adapt_part
from damageest.pipeline.collect import collect_result
from damageest.pipeline.coverage import describe_coverage, inspect_skin
from damageest.pipeline.deposits import make_deposits, separate_deposits
from damageest.pipeline.engine import Route
from damageest.pipeline.fallback import fall_back
from damageest.pipeline.form import correct_scan, fit_model, question_fit
from damageest.pipeline.grouped_enclosure import enclose_grouped
from damageest.pipeline.large_scans import add_points_near_damage
from damageest.pipeline.lost_bodies import add_lost_bodies
from damageest.pipeline.paths import plan_paths
from damageest.pipeline.prepare import (
    check_intact,
    crop_scan,
    gather_intact,
    measure_scan,
    place_scan,
    set_far_aside,
    settle_tolerance,
)
from damageest.pipeline.selections import check_selections
from damageest.pipeline.sites import (
    gather_sites,
    number_sites,
    set_specks_aside,
    take_clusters,
    take_enclosures,
    where_damaged,
)
from damageest.pipeline.surplus import find_surplus, relate_surplus
from damageest.pipeline.uncertainty import measure_uncertainty, sum_uncertainty
from damageest.pipeline.verdicts import choose_sites, gather_facts, judge_sites
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.allowance import Allowance
from damageest.stages.background import Background
from damageest.stages.boolean import Boolean
from damageest.stages.boundary import Boundary
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.export import Export
from damageest.stages.part import ReadPart
from damageest.stages.path import Path
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.repair import Repair
from damageest.stages.report import Report
from damageest.stages.sample import Sample
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

ACQUIRE: Route = (
    ReadPart, check_selections, ReadScan, crop_scan, set_far_aside, measure_scan, Sample, Align, place_scan,
    add_points_near_damage, correct_scan, adapt_part(Adapt), settle_tolerance, Segment, check_intact, inspect_skin,
    fit_model, Cluster, find_surplus, gather_intact,
)  # fmt: skip
BY_SITE: Route = (
    take_clusters, Reconstruct, Boundary, enclose_grouped(Background, Enclose), Repair, Boolean, gather_sites,
)  # fmt: skip
AT_ONCE: Route = (EncloseAll, take_enclosures, Boolean, gather_sites)
CLOSE: Route = (
    add_lost_bodies, set_specks_aside, number_sites, choose_sites, describe_coverage, relate_surplus, gather_facts,
    measure_uncertainty, judge_sites, question_fit, make_deposits(Allowance), separate_deposits, plan_paths(Path),
    sum_uncertainty, collect_result,
)  # fmt: skip

WRITE: Route = (Export,)
"""After one of the routes, where the result goes to files."""
SHOW: Route = (Report,)
"""After that, when the content of result.json is known."""


def route_of(method: str) -> Route:
    """The route of a job's `method`. Any other than the three belongs to an implementation that takes all sites at
    once, as `octree`."""
    middle = {"surface": BY_SITE, "auto": (fall_back(AT_ONCE, BY_SITE),)}.get(method, (where_damaged(*AT_ONCE),))
    return (*ACQUIRE, *middle, *CLOSE)
