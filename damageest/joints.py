"""What happens between stages: the values that follow from an artefact, and the turns from job to sites and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import DAMAGE, INTACT, OUTLIER, Deposit, Deviation, Floats, Part, Pose, Scan, Solid
from damageest.cache import digest
from damageest.engine import Engine, Joint, Route, State, follow
from damageest.errors import InputError, StageError
from damageest.evidence import weigh
from damageest.job import load
from damageest.measure import measure
from damageest.registry import Registry
from damageest.result import Result, Site
from damageest.settle import ids_surface, pieces_of, sites_of
from damageest.solids import iou, remainder, to_manifold, to_solid, united
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.units import diagnose_scale

AUTO_TOLERANCE = 4.0
"""Lambda over the scan's noise where the job says auto: 6 in 100,000 sound points deviate by more."""

FEW = 100
"""Damaged points below which a site's volume is that of a sketch: a chip of 30 points came out 15 % small."""


def measured(engine: Engine, lanes: list[State]) -> list[State]:
    """Measures the scan's noise and spacing, settles the tolerance, and refuses a scan of another size."""
    (state,) = lanes
    scan, part = state["scan"], state["part"]
    if wrong_size := diagnose_scale(scan.points, part.vertices, part.unit):
        raise InputError(f"scan: {wrong_size}")
    if not scan.noise:
        key = digest("measure", state.keys["scan"])
        _, (noise, spacing) = engine.remember("measure", key, lambda: measure(scan.points))
        scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, warnings = tolerance_of(engine.job.tolerance, scan, part)
    engine.warnings += warnings
    state = state.derive("scan", scan, "scan")
    return [state.add("tolerance", tolerance, digest(tolerance))]


def tolerance_of(wanted: float | None, scan: Scan, part: Part) -> tuple[float, list[str]]:
    """Lambda in the job's unit, and what is doubtful about it."""
    least = 1e-4 * part.diagonal
    tolerance = wanted or max(AUTO_TOLERANCE * scan.noise, 2 * part.tessellation_error, least)
    warnings = []
    if tolerance < 3 * scan.noise:
        warnings.append(
            f"the tolerance {tolerance:.3g} is less than three times the scan's noise {scan.noise:.3g}: sound surface "
            f"may pass for damage; {AUTO_TOLERANCE * scan.noise:.3g} would be safe"
        )
    if part.tessellation_error > tolerance / 2:
        warnings.append(
            f"the part's triangles deviate from the CAD surface by up to {part.tessellation_error:.3g}, more than half "
            f"the tolerance {tolerance:.3g}; ask for a finer chord"
        )
    if scan.spacing > 5 * tolerance:
        warnings.append(
            f"the scan's points lie {scan.spacing:.3g} apart, far more than the tolerance {tolerance:.3g}: the damage "
            "surface between them is interpolated"
        )
    return tolerance, warnings


def placed(engine: Engine, lanes: list[State]) -> list[State]:
    """Brings the scan into the part's frame."""
    (state,) = lanes
    pose, scan = state["pose"], state["scan"]
    engine.warnings += pose.notes
    state = state.derive("aligned", scan.moved(pose.T_part_scan), "scan", "pose")
    return [state.derive("noise", scan.noise, "scan").derive("spacing", scan.spacing, "scan")]


def damaged(engine: Engine, lanes: list[State]) -> list[State]:
    """Goes on only where there is a site to go on with."""
    (state,) = lanes
    aligned, deviation = state["aligned"], state["deviation"]
    engine.warnings += [*deviation.notes, *state["sites"].notes]
    state = state.derive("intact", aligned.points[deviation.label == INTACT], "aligned", "deviation")
    engine.whole = state
    return [state] if state["sites"].count else []


def each_cluster(engine: Engine, lanes: list[State]) -> list[State]:
    """From the job to its sites: one lane for each cluster of points, or for those still ``wanted``."""
    fine = not getattr(engine.job.stages[Enclose], "refines", False)
    return [
        state.at(k)
        .derive("points", state["aligned"].points[state["sites"].members(k)], "aligned", "sites")
        .derive("clusters", (k,), "sites")
        .derive("method", "surface")
        .add("fine", fine, digest(fine))
        for state in lanes
        for k in state.values.get("wanted", range(1, state["sites"].count + 1))
    ]


def each_enclosure(engine: Engine, lanes: list[State]) -> list[State]:
    """From the job to one lane for each enclosure."""
    return [
        state.at(k)
        .derive("solid", item.solid, "enclosures")
        .derive("clusters", item.sites, "enclosures")
        .derive("notes", item.notes, "enclosures")
        .derive("method", engine.job.stages[EncloseAll].use)
        for state in lanes
        for k, item in enumerate(state["enclosures"].items, 1)
    ]


def settled(engine: Engine, lanes: list[State]) -> list[State]:
    """From damage volumes to sites, each weighed against the scan; clusters left without a volume are failures."""
    if not lanes:
        return []
    whole = lanes[0].at(0)
    aligned, sites, part, tolerance = (whole[name] for name in ("aligned", "sites", "part", "tolerance"))
    reach = max(2 * tolerance, aligned.spacing)
    pieces, dropped = [], 0.0
    for lane in lanes:
        if lane["damage"] is not None:
            members = np.flatnonzero(np.isin(sites.label, lane["clusters"]))
            found, scraps = pieces_of(lane["damage"], aligned.points[members], sites.label[members], reach)
            pieces += found
            dropped += scraps
    out = []
    for site in sites_of(pieces):
        members = np.flatnonzero(np.isin(sites.label, site.clusters))
        state = whole.derive("clusters", site.clusters, "sites").derive("members", members, "sites")
        state = state.add("damage", site.damage, digest(site.damage)).add("method", lanes[0]["method"], "")
        evidence = weigh(site.damage, aligned.points[members], aligned, whole["deviation"], part, tolerance)
        doubts = [
            note
            for lane in lanes
            if set(lane["clusters"]) & set(site.clusters)
            for note in lane.values.get("notes", ())
        ]
        out.append(state.add("evidence", evidence, "").add("doubts", tuple(dict.fromkeys(doubts)), ""))
    covered = {cluster for site in out for cluster in site["clusters"]}
    for cluster in sorted({c for lane in lanes for c in lane["clusters"]} - covered):
        error = StageError("its points bound no volume of the part", "the other method, or a smaller tolerance")
        error.stage, error.use, error.site = "boolean", lanes[0]["method"], cluster
        engine.failures.append(error)
    if dropped > 1e-3 * sum(site["damage"].volume for site in out):
        engine.warnings.append(f"pieces of {dropped:.3g} in volume that no damaged point touches were dropped")
    return out


def either(first: Route, second: Route) -> Joint:
    """The first route, and the second one for each site that it fails on or that the scan refutes."""

    def joint(engine: Engine, lanes: list[State]) -> list[State]:
        if not lanes:
            return []
        (state,) = lanes
        failed = list(engine.failures)
        try:
            found = follow(first, engine, lanes)
        except StageError as error:
            engine.warnings.append(f"fell back to method surface: {error}")
            found = []
        engine.failures = failed
        sound = [lane for lane in found if lane["evidence"].consistent]
        good = {cluster for lane in sound for cluster in lane["clusters"]}
        wanted = tuple(k for k in range(1, state["sites"].count + 1) if k not in good)
        if not wanted:
            return found
        others = follow(second, engine, [state.derive("wanted", wanted, "sites")])
        better = [lane for lane in others if lane["evidence"].consistent]
        doubtful = []
        for lane in (lane for lane in found if not lane["evidence"].consistent):
            takers = [other for other in better if set(other["clusters"]) & set(lane["clusters"])]
            if {c for other in takers for c in other["clusters"]} >= set(lane["clusters"]):
                sound += [other for other in takers if other not in sound]
            else:
                doubtful.append(lane)
        done = {cluster for lane in (*sound, *doubtful) for cluster in lane["clusters"]}
        rest = [lane for lane in others if not done & set(lane["clusters"])]
        done |= {cluster for lane in rest for cluster in lane["clusters"]}
        engine.failures = failed + [error for error in engine.failures[len(failed) :] if error.site not in done]
        return [*sound, *doubtful, *rest]

    return joint


def numbered(engine: Engine, lanes: list[State]) -> list[State]:
    """Numbers the sites, largest first."""
    ordered = sorted(lanes, key=lambda lane: -lane["damage"].volume)
    return [lane.at(number) for number, lane in enumerate(ordered, 1)]


def gather(engine: Engine, lanes: list[State]) -> list[State]:
    """From the sites back to the job: the result. Raises the first failure where there are failures and no site."""
    whole = engine.whole
    if engine.failures and not lanes:
        raise engine.failures[0]
    part, scan, aligned, deviation = (whole[name] for name in ("part", "scan", "aligned", "deviation"))
    sites = tuple(_site(lane, part, deviation) for lane in lanes)
    label = np.zeros(len(scan.points), np.int32)
    for site in sites:
        label[site.points] = site.id
    kept = deviation.label.copy()
    kept[(kept == DAMAGE) & (whole["sites"].label == 0)] = OUTLIER
    origin = part.bounds.mean(axis=0)
    lost = united((site.damage for site in sites), origin)
    damage = to_solid(lost, origin)
    # a cut-back is no damage: what was found is compared as it was found
    cut_back = any(site.damage is not lane["damage"] for site, lane in zip(sites, lanes, strict=True))
    found = to_solid(united((lane["damage"] for lane in lanes), origin), origin) if cut_back else damage
    result = Result(
        name=engine.job.name,
        units=engine.job.units,
        tolerance=whole["tolerance"],
        part=part,
        scan=scan,
        aligned=aligned,
        pose=whole["pose"],
        deviation=replace(deviation, label=kept),
        site_label=label,
        sites=sites,
        damage=damage,
        undamaged=to_solid(remainder(to_manifold(part, origin), lost), origin) if sites else part,
        warnings=tuple(dict.fromkeys(engine.warnings)),
        failures=tuple(str(error) for error in engine.failures),
        truth=_against_truth(found, scan, whole["pose"], whole["tolerance"]),
    )
    return [whole.at(0).add("result", result, "")]


def _site(lane: State, part: Part, deviation: Deviation) -> Site:
    evidence, members = lane["evidence"], lane["members"]
    warnings = tuple(lane["doubts"])
    if len(members) < FEW:
        warnings = (
            f"only {len(members)} scan points lie on it; for a volume to rely on, scan it more densely",
            *warnings,
        )
    if not evidence.consistent:
        warnings = (f"the scan does not bear this damage volume out: {'; '.join(evidence.reasons)}", *warnings)
    deposit = lane["deposit"]
    damage = lane["damage"]
    if isinstance(deposit, Deposit):
        damage = deposit.cavity or damage
        warnings += deposit.notes
    return Site(
        id=lane.site,
        clusters=lane["clusters"],
        points=members,
        damage=damage,
        surface=ids_surface(damage, part),
        deposit=deposit,
        refused=lane.values.get("refused", False),
        method=lane["method"],
        evidence=evidence,
        max_depth=max(float(-deviation.distance[members].min()), 0.0),
        warnings=warnings,
    )


def _against_truth(damage: Solid | None, scan: Scan, pose: Pose, tolerance: float) -> Floats | None:
    """(volume, IoU) against a virtual scan's known damage. On a symmetric part any of the poses it maps onto itself is
    right, so where the pose found is another one, the truth is moved along."""
    if scan.truth is None:
        return None
    truth = scan.truth.damage
    if truth is None:
        return np.array([0.0, iou(None, damage)])
    D = pose.T_part_scan @ np.linalg.inv(scan.truth.T_part_scan)
    moved = truth.vertices @ D[:3, :3].T + D[:3, 3]
    if np.linalg.norm(moved - truth.vertices, axis=1).max() > 5 * tolerance:
        truth = Solid(moved, truth.faces)
    return np.array([truth.volume, iou(truth, damage)])


def inspected(source: Mapping[str, Any], registry: Registry) -> tuple[Part, Scan, float, list[str]]:
    """Part, measured scan, a tolerance for them, and what is doubtful; for a starter job."""
    job = load(source, registry)
    engine = Engine(job, registry)
    values = {"unit": job.units, "tolerance": None}
    state = State(values, {name: digest(value) for name, value in values.items()})
    state = engine.call(ReadScan, engine.call(ReadPart, state))
    scan, part = state["scan"], state["part"]
    doubts = [doubt] if (doubt := diagnose_scale(scan.points, part.vertices, part.unit)) else []
    noise, spacing = measure(scan.points)
    scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, more = tolerance_of(None, scan, part)
    return part, scan, tolerance, doubts + more
