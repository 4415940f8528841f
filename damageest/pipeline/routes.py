"""The routes: which contracts are called in which order, and the steps between them.

A contract calls the implementation that the job names, once per job or once per site as the contract says. A step is
the code between them. Beside each stands what it takes and what it gives, by the names of `JobState` and, for what is
called once per site, of `Candidate`; ``+``: it adds to what is there; ``calls``: contracts that a step calls itself. A
test compares these lines with the code. Points on the skin are made where an implementation takes them.
"""

from __future__ import annotations

from damageest.pipeline.engine import Route
from damageest.pipeline.finding.coverage import describe_coverage, inspect_skin
from damageest.pipeline.finding.fallback import fall_back
from damageest.pipeline.finding.grouped_enclosure import enclose_grouped
from damageest.pipeline.finding.sites import (
    complete_sites,
    gather_sites,
    take_clusters,
    take_enclosures,
    where_damaged,
)
from damageest.pipeline.finding.surplus import find_surplus, relate_surplus
from damageest.pipeline.judging.collect import collect_result
from damageest.pipeline.judging.deposits import make_deposits
from damageest.pipeline.judging.paths import plan_paths
from damageest.pipeline.judging.scan_errors import measure_scan_errors
from damageest.pipeline.judging.sections import cut_sections
from damageest.pipeline.judging.sensor import (
    dismiss_explained_clusters,
    dismiss_explained_sites,
)
from damageest.pipeline.judging.uncertainty import measure_uncertainty, sum_uncertainty
from damageest.pipeline.judging.verdicts import choose_sites, judge_sites
from damageest.pipeline.placing.adapt import adapt_part
from damageest.pipeline.placing.alignment import align_scan
from damageest.pipeline.placing.form import correct_scale, correct_views, fit_model, review_model_fit
from damageest.pipeline.placing.large_scans import add_points_near_damage
from damageest.pipeline.placing.prepare import (
    check_clusters,
    clean_scan,
    measure_scan,
    place_scan,
    remove_filled_points,
    settle_tolerance,
    take_tolerance,
)
from damageest.pipeline.placing.selections import check_selections
from damageest.pipeline.placing.temperature import correct_temperature
from damageest.pipeline.writing import (
    describe_output,
    show_result,
    write_measured,
    write_output,
)
from damageest.stages.boolean import Boolean
from damageest.stages.boundary import Boundary
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import EncloseAll
from damageest.stages.export import Export
from damageest.stages.part import ReadPart
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.repair import Repair
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

ACQUIRE: Route = (
    ReadPart,  # unit, tolerance -> part
    check_selections,  # part ->
    ReadScan,  # unit, part -> scan
    clean_scan,  # scan, part, reader, unit -> scan, +warnings
    correct_temperature,  # scan, temperature -> scan, thermal_scale, scan_centre
    measure_scan,  # scan, part, aligner -> measured_noise, measured_spacing, depth_step
    take_tolerance,  # scan, part, measured_noise, measured_spacing, depth_step, asked_tolerance
    #     -> tolerance, +warnings
    remove_filled_points,  # scan, measured_noise, measured_spacing -> scan, +warnings
    align_scan,  # calls Align: adapter, aligner, tolerance, asked_tolerance, part, scan, samples
    #     -> scan, part, pose, refusal, +warnings
    add_points_near_damage,  # reader, scan, pose, part, tolerance, unit, thermal_scale, scan_centre -> scan
    place_scan,  # scan, pose, part, tolerance, unit -> scan, aligned, +warnings
    correct_views,  # calls Align: registration, asked_tolerance, aligner, unit, scan, part, samples, tolerance
    #     -> registration, views
    correct_scale,  # registration, unit, reader, scan_centre -> registration, corrected_scale
    adapt_part,  # calls Adapt, Align: registration, part, aligned, pose, refusal, tolerance, unit, views, adapter,
    #     aligner, scan, samples -> registration, adapted, asked_fit
    settle_tolerance,  # tolerance, asked_tolerance, part, aligned -> tolerance, +warnings
    Segment,  # aligned, part, samples, tolerance -> deviation
    inspect_skin,  # field, segmenter -> skin, deviation, sheets
    Cluster,  # aligned, deviation, tolerance -> sites
    check_clusters,  # sites, field ->
    find_surplus,  # calls Cluster, EncloseAll: unit, sheets, field, aligned, deviation, tolerance, part, sites,
    #     samples, nearby -> surplus, deviation, +warnings
    fit_model,  # field, adapted, surplus, unit, views, corrected_scale, asked_fit -> fitted, +warnings
    dismiss_explained_clusters,  # field, sites, sheets, views, aligner, accept -> sites, explained
)
BY_SITE: Route = (
    take_clusters,  # aligned, sites, encloser, wanted -> candidates
    Reconstruct,  # points, part, tolerance, spacing, noise -> surface
    Boundary,  # surface, part, tolerance -> rims
    enclose_grouped,  # calls Background, Enclose: candidates, aligned, sites, part, tolerance, spacing, intact, samples
    #     -> candidates, +failures
    Repair,  # enclosure, tolerance -> solid
    Boolean,  # solid, part -> damage
    gather_sites,  # candidates, sites, field, unit -> found, +failures, +warnings
)
AT_ONCE: Route = (
    EncloseAll,  # part, aligned, deviation, sites, samples, nearby, tolerance -> enclosures
    take_enclosures,  # enclosures, aligned, sites, encloser_at_once -> candidates, +failures
    Boolean,  # solid, part -> damage
    gather_sites,  # candidates, sites, field, unit -> found, +failures, +warnings
)
CLOSE: Route = (
    complete_sites,  # calls Reconstruct: part, skin, found, failures, sites, field, unit, tolerance, spacing, noise
    #     -> found, failures, +warnings
    choose_sites,  # found, choice, field -> found, +warnings
    describe_coverage,  # field, skin, found -> coverage
    relate_surplus,  # surplus, found, field, unit -> surplus, found, +warnings
    measure_scan_errors,  # field, skin, surplus, sheets, pose, aligner, unit, fitted, adapted, sites, explained,
    #     depth_step, scanner, temperature, corrected_scale -> errors, sensor, +warnings
    measure_uncertainty,  # found, part, aligned, field, adapted, skin, coverage, errors, fitted, pose, terms,
    #     tolerance, unit, adapter, warnings -> found
    judge_sites,  # found, accept, rules, terms, errors, field, skin, coverage, pose, unit, views, aligner -> found
    dismiss_explained_sites,  # found, sensor, explained, sheets, aligner, accept, tolerance, asked_tolerance, unit,
    #     field -> found, folded, +warnings
    review_model_fit,  # fitted, surplus, found, pose, field, adapted, skin, unit, explained, warnings
    #     -> fitted, warnings
    make_deposits,  # calls Allowance: found, part, tolerance -> found, +failures
    plan_paths,  # calls Path: found, part, tolerance, reach -> found, +failures
    sum_uncertainty,  # found, failures, pose, field, adapted, folded, views, sensor, unit
    #     -> volume_95, budget
    cut_sections,  # asked_sections, field, adapted, errors, sensor, unit -> sections, +warnings
    collect_result,  # name, unit, tolerance, part, scan, aligned, field, pose, deviation, sites, found, failures,
    #     warnings, coverage, surplus, adapted, fitted, sensor, volume_95, budget, errors, conversions,
    #     sections, corrected_scale, thermal_scale, scan_centre -> result
)
WRITE: Route = (
    Export,  # result, folder, writers, path_writers -> written
    write_measured,  # written, result, folder -> written
    describe_output,  # result, written, target -> result, content, job_text
    show_result,  # calls Report: written, result, folder, content, job_text -> result, written
    write_output,  # result, written, folder, target ->
)
"""After one of the routes, where the result goes to files."""


def route_of(method: str) -> Route:
    """The route of a job's `method`. Any other than the three belongs to an implementation that takes all sites at
    once, as `octree`."""
    middle = {
        "surface": BY_SITE,
        "auto": (fall_back(AT_ONCE, BY_SITE),),
        "both": (fall_back(AT_ONCE, BY_SITE, compares=True),),
    }.get(method, (where_damaged(*AT_ONCE),))
    return (*ACQUIRE, *middle, *CLOSE)
