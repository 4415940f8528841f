"""Steps from the job to candidates for sites, and from their damage volumes to the sites."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Ints, Reason
from damageest.checks.evidence import weigh_evidence
from damageest.errors import StageError
from damageest.geometry.pieces import find_pieces, join_pieces
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Step, describe_points, follow
from damageest.pipeline.state import Candidate, FoundSite, JobState, Work
from damageest.registry.contracts import Contract
from damageest.stages.enclose import Enclose, EncloseAll

SPECK = 50
"""Points of a cluster below which a failure to enclose it is a warning and not a failure of the run."""


def where_damaged(*route: Contract | Step) -> Step:
    """A step that follows a route only where the scan shows damage."""

    def run(engine: Engine, work: Work) -> Work:
        return follow(route, engine, work) if work.job.sites.count else work

    return run


def take_clusters(engine: Engine, work: Work) -> Work:
    """Makes a candidate of each cluster of damaged points, or of each that is still wanted."""
    state = work.job
    fine = not getattr(engine.job.stages[Enclose], "refines", False)
    wanted = range(1, state.sites.count + 1) if work.wanted is None else work.wanted
    candidates = []
    for number in wanted:
        points = state.aligned.points[state.sites.members(number)]
        key = digest("points", number, state.key("aligned"), state.key("sites"))
        candidate = Candidate(job=state, number=number, clusters=(number,), method="surface")
        candidate = candidate.with_value(Candidate.points, points, key)
        candidates.append(candidate.with_value(Candidate.fine, fine, digest(fine)))
    return replace(work, candidates=tuple(candidates))


def take_enclosures(engine: Engine, work: Work) -> Work:
    """Makes a candidate of each enclosure. Sites that none of them names are failures."""
    state, method = work.job, engine.job.stages[EncloseAll].use
    candidates = []
    for number, item in enumerate(state.enclosures.items, 1):
        candidate = Candidate(job=state, number=number, clusters=item.sites, method=method, notes=item.notes)
        key = digest("solid", number, state.key("enclosures"))
        candidates.append(candidate.with_value(Candidate.solid, item.solid, key))
    failures = []
    for number in sorted(set(range(1, state.sites.count + 1)) - {site for c in candidates for site in c.clusters}):
        error = StageError("gave no enclosure of its points", "a smaller tolerance", method="surface")
        error.stage, error.use, error.site = EncloseAll.stage, method, number
        error.place = describe_points(state, (number,))
        failures.append(error)
    return replace(work, candidates=tuple(candidates), failures=(*work.failures, *failures))


def gather_sites(engine: Engine, work: Work) -> Work:
    """Turns damage volumes into sites, each compared with the scan. Clusters left without a volume are failures."""
    if not work.candidates:
        return work
    state, method = work.job, work.candidates[0].method
    aligned, sites, tolerance = state.aligned, state.sites, state.tolerance
    reach = max(2 * tolerance, aligned.spacing)
    pieces, dropped = [], 0.0
    for candidate in work.candidates:
        if candidate.damage is not None:
            members = np.flatnonzero(np.isin(sites.label, candidate.clusters))
            found, scraps = find_pieces(candidate.damage, aligned.points[members], sites.label[members], reach)
            pieces += found
            dropped += scraps
    out = []
    for item in join_pieces(pieces):
        members = np.flatnonzero(np.isin(sites.label, item.clusters))
        evidence = weigh_evidence(item.damage, aligned.points[members], aligned, state.deviation, state.part, tolerance)
        sources = [candidate for candidate in work.candidates if set(candidate.clusters) & set(item.clusters)]
        notes = [note for candidate in sources for note in candidate.notes]
        site = FoundSite(
            job=state, clusters=item.clusters, method=method, members=members, evidence=evidence,
            notes=tuple(dict.fromkeys(notes)), enclosures=tuple(candidate.solid for candidate in sources),
        )  # fmt: skip
        out.append(site.with_value(FoundSite.damage, item.damage, digest(item.damage)))
    covered = {cluster for site in out for cluster in site.clusters}
    failures = []
    for cluster in sorted({c for candidate in work.candidates for c in candidate.clusters} - covered):
        error = StageError(
            "no damage volume could be computed from its points", "a smaller tolerance", name_other(method)
        )
        error.stage, error.use, error.site = "boolean", method, cluster
        error.place = describe_points(state, (cluster,))
        failures.append(error)
    warnings = []
    if dropped > 1e-3 * sum(site.damage.volume for site in out):
        text = f"pieces of {dropped:.3g} {state.unit}³ that no damaged point touches were dropped"
        warnings.append(Reason("scraps", text, amount=dropped, unit=f"{state.unit}³"))
    return replace(
        work, candidates=(), sites=tuple(out), failures=(*work.failures, *failures),
        warnings=(*work.warnings, *warnings),
    )  # fmt: skip


def name_other(method: str) -> str:
    """The method to try where a method failed."""
    return "implicit" if method == "surface" else "surface"


def find_place(state: JobState, members: Ints) -> tuple[float, float, float]:
    """Where scan points ``members`` (M,) lie, in the part's frame."""
    x, y, z = np.median(state.aligned.points[members], axis=0).tolist()
    return x, y, z


def set_specks_aside(engine: Engine, work: Work) -> Work:
    """Turns failures on clusters that are too small to be enclosed into warnings: stray points form such clusters."""
    failures, warnings = [], []
    state = work.job
    for error in work.failures:
        members = state.sites.members(error.site) if error.place and error.site else np.empty(0, np.int64)
        if 0 < len(members) < SPECK:
            depth = float(-state.deviation.distance[members].min())
            text = (
                f"{error.place}, up to {depth:.3g} {state.unit} deep, are too few to bound a volume and were left out"
            )
            place = find_place(state, members)
            warnings.append(Reason("speck", text, amount=depth, unit=state.unit, place=place))
        else:
            failures.append(error)
    return replace(work, failures=tuple(failures), warnings=(*work.warnings, *warnings))


def number_sites(engine: Engine, work: Work) -> Work:
    """Numbers the sites, largest first."""
    ordered = sorted(work.sites, key=lambda site: -site.damage.volume)
    return replace(work, sites=tuple(replace(site, number=number) for number, site in enumerate(ordered, 1)))
