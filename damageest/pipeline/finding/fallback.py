"""A branch: one route, and another one for the sites that the first fails on or that the scan contradicts."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Reason, Sites
from damageest.errors import StageError
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Branch, Engine, Route, follow
from damageest.pipeline.finding.other_method import note_other_volumes
from damageest.pipeline.state import FoundSite, JobState

BUDGET = 40
"""Clusters that the second route is followed for, those of most points. Counted and not timed, so that the same job
gives the same bytes."""


def fall_back(first: Route, second: Route, compares: bool = False) -> Branch:
    """Follows ``first``, and ``second`` for the clusters without a site that the scan agrees with.

    A site of the first route whose evidence is against it stays unless sites of the second route, with evidence for
    them, stand for all of its clusters. Failures of the first route are not reported: the second route has its own.

    ``compares``: the second route is followed for all clusters, and each site has its volume by the other route too.
    """

    def run(engine: Engine, state: JobState) -> JobState:
        if not state.sites.count:
            return state
        before = state.failures
        state = state.with_value(JobState.failures, (), state.key("failures"))
        try:
            tried = follow(first, engine, state)
        except StageError as error:
            text = str(error).partition("\n")[0]  # its remedy is another method, and that is what follows
            told = Reason("fell_back", f"method surface used: implicit failed: {text}", remedy="set method: surface")
            tried = state.with_value(JobState.warnings, (*state.warnings, told))
        agreed = {cluster for site in tried.found if site.evidence.consistent for cluster in site.clusters}
        wanted = tuple(k for k in range(1, state.sites.count + 1) if compares or k not in agreed)
        if not wanted:
            return tried.with_value(JobState.failures, before, state.key("failures"))
        wanted, left = (wanted, ()) if compares else share_budget(state.sites, wanted)
        again = state.with_value(JobState.warnings, tried.warnings, tried.key("warnings"))
        again = follow(second, engine, again.with_value(JobState.wanted, wanted))
        sites = merge_sites(tried.found, again.found)
        if compares:
            sites = note_other_volumes(sites, tried.found, again.found)
        done = {cluster for site in sites for cluster in site.clusters}
        lacking = next((error for error in again.failures if error.extra), None)
        if lacking is not None and any(error.site in done for error in again.failures):
            again = again.with_value(JobState.warnings, (*again.warnings, _note_missing(lacking)))
        failures = tuple(drop_tried(error) for error in again.failures if error.site not in done)
        left = tuple(number for number in left if number not in done)
        failures += (report_exhausted_budget(state.sites, left),) if left else ()
        key = digest("compared" if compares else "fall_back", tried.key("found"), again.key("found"))
        return again.with_value(JobState.found, sites, key).with_value(JobState.failures, (*before, *failures), key)

    return Branch("fall_back", ("sites", "failures", "warnings"), (first, second), run)


def share_budget(sites: Sites, wanted: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The clusters of most points, at most `BUDGET`, and those that are left; both in the order of their numbers."""
    size = np.bincount(sites.label, minlength=sites.count + 1)
    ordered = sorted(wanted, key=lambda number: (-size[number], number))
    return tuple(sorted(ordered[:BUDGET])), tuple(sorted(ordered[BUDGET:]))


def report_exhausted_budget(sites: Sites, left: tuple[int, ...]) -> StageError:
    """One failure for all clusters that the second route was not tried on: their volume is not known."""
    count, points = len(left), int(np.isin(sites.label, left).sum())
    places = f"{count} more places" if count > 1 else "1 more place"
    error = StageError(
        f"method surface was tried on the {BUDGET} largest places that implicit gave no volume for; {places} with "
        f"{points} points were left out",
        "a larger tolerance, or a scan with less noise; method: surface goes through all of them",
    )
    error.stage, error.use = "enclose", "surface"
    return error


def drop_tried(error: StageError) -> StageError:
    """The error without the remedy that was tried already: the other method."""
    if error.extra:
        error.message = f"method implicit gave no site, and method surface cannot be tried: {error.message}"
        error.args = (error.message,)
        return error
    tried = "a smaller tolerance, or a denser scan of this place; both methods were tried"
    error.remedy, error.method = error.own_remedy or tried, ""
    return error


def _note_missing(error: StageError) -> Reason:
    """What a result lacks where the second route could not be tried, as it would be with all extras."""
    text = f"the scan contradicts a site of method implicit, and method surface cannot be tried: {error.message}"
    return Reason("fell_back", text, remedy=error.remedy)


def merge_sites(first: tuple[FoundSite, ...], second: tuple[FoundSite, ...]) -> tuple[FoundSite, ...]:
    """Of the sites of two routes, those that the scan agrees with; for clusters without such a one, the first route's,
    and else the second's."""
    kept = [site for site in first if site.evidence.consistent]
    better = [site for site in second if site.evidence.consistent]
    doubtful: list[FoundSite] = []
    for site in (site for site in first if not site.evidence.consistent):
        takers = [other for other in better if set(other.clusters) & set(site.clusters)]
        if {cluster for other in takers for cluster in other.clusters} >= set(site.clusters):
            kept += [other for other in takers if other not in kept]
        else:
            doubtful.append(site)
    done = {cluster for site in (*kept, *doubtful) for cluster in site.clusters}
    return (*kept, *doubtful, *(site for site in second if not done & set(site.clusters)))
