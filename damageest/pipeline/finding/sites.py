"""Steps from the job to candidates for sites, and from their damage volumes to the sites."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Enclosures, Floats, Ints, Reason, Scan, Sites
from damageest.errors import StageError
from damageest.geometry.pieces import find_pieces, join_pieces
from damageest.geometry.scan_field import ScanField
from damageest.pipeline.engine import AnyStep, Branch, Engine, follow
from damageest.pipeline.finding.lost_bodies import add_lost_bodies
from damageest.pipeline.finding.pores import add_pores
from damageest.pipeline.stage_errors import describe_points
from damageest.pipeline.state import Candidate, Failures, FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.registry.contracts import Contract
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.reconstruct import Reconstruct
from damageest.trust.evidence import weigh_evidence

SPECK = 50
"""Points of a cluster below which a failure to enclose it is a warning and not a failure of the run."""


def where_damaged(*route: Contract | AnyStep) -> Branch:
    """Follows a route only where the scan shows damage."""

    def run(engine: Engine, state: JobState) -> JobState:
        return follow(route, engine, state) if state.sites.count else state

    return Branch("where_damaged", ("sites",), (route,), run)


@step(gives="candidates")
def take_clusters(
    aligned: Scan, sites: Sites, encloser: Enclose | None, wanted: tuple[int, ...] | None
) -> tuple[Candidate, ...]:
    """Makes a candidate of each cluster of damaged points, or of each that is still wanted."""
    fine = encloser is None or not encloser.refines
    candidates = []
    for number in range(1, sites.count + 1) if wanted is None else wanted:
        candidate = Candidate(number=number, clusters=(number,), method="surface")
        candidate = candidate.with_value(Candidate.points, aligned.points[sites.members(number)])
        candidates.append(candidate.with_value(Candidate.fine, fine))
    return tuple(candidates)


@step(gives=("candidates", "failures"))
def take_enclosures(
    enclosures: Enclosures, aligned: Scan, sites: Sites, encloser_at_once: EncloseAll | None
) -> tuple[tuple[Candidate, ...], Failures]:
    """Makes a candidate of each enclosure. Sites that none of them names are failures."""
    method = encloser_at_once.use if encloser_at_once else ""
    candidates = []
    for number, item in enumerate(enclosures.items, 1):
        candidate = Candidate(number=number, clusters=item.sites, method=method, notes=item.notes)
        candidates.append(candidate.with_value(Candidate.solid, item.solid))
    failures = []
    for number in sorted(set(range(1, sites.count + 1)) - {site for c in candidates for site in c.clusters}):
        error = StageError("gave no enclosure of its points", "a smaller tolerance", method="surface")
        error.stage, error.use, error.site = EncloseAll.stage, method, number
        error.place = describe_points(sites, aligned, (number,))
        failures.append(error)
    return tuple(candidates), failures


@step(gives=("found", "failures", "warnings"))
def gather_sites(
    candidates: tuple[Candidate, ...], sites: Sites, field: ScanField, unit: str
) -> tuple[tuple[FoundSite, ...], Failures, Reasons]:
    """Turns damage volumes into sites, each compared with the scan. Clusters left without a volume are failures."""
    if not candidates:
        return (), (), ()
    method, aligned = candidates[0].method, field.aligned
    reach = max(2 * field.tolerance, aligned.spacing)
    pieces, dropped = [], 0.0
    for candidate in candidates:
        if candidate.damage is not None:
            members = np.flatnonzero(np.isin(sites.label, candidate.clusters))
            bodies, scraps = find_pieces(candidate.damage, aligned.points[members], sites.label[members], reach)
            pieces += bodies
            dropped += scraps
    out = []
    for item in join_pieces(pieces):
        members = np.flatnonzero(np.isin(sites.label, item.clusters))
        evidence = weigh_evidence(item.damage, aligned.points[members], field)
        sources = [candidate for candidate in candidates if set(candidate.clusters) & set(item.clusters)]
        notes = [note for candidate in sources for note in candidate.notes]
        site = FoundSite(
            clusters=item.clusters, method=method, members=members, evidence=evidence,
            notes=tuple(dict.fromkeys(notes)), enclosures=tuple(candidate.solid for candidate in sources),
        )  # fmt: skip
        out.append(site.with_value(FoundSite.damage, item.damage))
    covered = {cluster for site in out for cluster in site.clusters}
    failures = []
    for cluster in sorted({c for candidate in candidates for c in candidate.clusters} - covered):
        error = StageError(
            "no damage volume could be computed from its points", "a smaller tolerance", name_other(method)
        )
        error.stage, error.use, error.site = "boolean", method, cluster
        error.place = describe_points(sites, aligned, (cluster,))
        failures.append(error)
    warnings = []
    if dropped > 1e-3 * sum(site.damage.volume for site in out):
        text = f"dropped {dropped:.3g} {unit}³ of fragments without scan points"
        warnings.append(Reason("scraps", text, amount=dropped, unit=f"{unit}³"))
    return tuple(out), failures, warnings


def name_other(method: str) -> str:
    """The method to try where a method failed."""
    return "implicit" if method == "surface" else "surface"


def find_place(points: Floats, members: Ints) -> tuple[float, float, float]:
    """Where scan points ``members`` (M,) lie, of ``points`` (N,3) in the part's frame."""
    x, y, z = np.median(points[members], axis=0).tolist()
    return x, y, z


@step(
    gives=("found", "failures", "warnings"),
    reads=("part", "skin", "found", "failures", "sites", "field", "unit"),
    calls=(Reconstruct,),
)
def complete_sites(engine: Engine, state: JobState) -> tuple[tuple[FoundSite, ...], Failures, Reasons]:
    """Adds the sites that no enclosure gives: bodies of the part that are gone altogether, and pores."""
    found = add_lost_bodies(state.part, state.skin, state.found)
    found, failures = add_pores(engine, state, found) if state.failures else (found, state.failures)
    kept, told = _dismiss_specks(failures, state.sites, state.field, state.unit)
    return found, kept, told


def _dismiss_specks(failures: Failures, sites: Sites, field: ScanField, unit: str) -> tuple[Failures, Reasons]:
    """Turns failures on clusters that are too small to be enclosed into warnings: stray points form such clusters."""
    kept, warnings = [], []
    for error in failures:
        members = sites.members(error.site) if error.place and error.site else np.empty(0, np.int64)
        if 0 < len(members) < SPECK:
            depth = float(-field.distance[members].min())
            text = f"{error.place}, up to {depth:.3g} {unit} deep, are too few for a volume and were left out"
            place = find_place(field.points, members)
            warnings.append(
                Reason("speck", text, amount=depth, unit=unit, place=place, remedy="scan this place more densely")
            )
        else:
            kept.append(error)
    return kept, warnings


def number_sites(found: tuple[FoundSite, ...]) -> tuple[FoundSite, ...]:
    """Numbers the sites, largest first."""
    ordered = sorted(found, key=lambda site: -site.damage.volume)
    return tuple(replace(site, number=number) for number, site in enumerate(ordered, 1))
