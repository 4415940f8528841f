"""The step from the sites back to the job: the result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import ADDED, DAMAGE, OUTLIER, Deposit, Floats, Pose, Scan, Solid
from damageest.geometry.remaining import subtract_from_part
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import extract_ids
from damageest.geometry.solids import iou, to_solid, unite
from damageest.geometry.transforms import move_points
from damageest.output.result_json import to_dict
from damageest.pipeline.engine import Engine
from damageest.pipeline.judging.uncertainty import shift_interval, shift_uncertainty
from damageest.pipeline.state import FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.registry.contracts import DEFAULTS
from damageest.result import Result, Site
from damageest.rules.notes import make_notes, rank_notes
from damageest.stages.sample import Sample
from damageest.trust.interval.budget import UNKNOWN


@step(
    gives="result",
    reads=(
        "name", "unit", "tolerance", "part", "scan", "aligned", "field", "pose", "deviation", "sites", "found",
        "failures", "warnings", "coverage", "surplus", "adapted", "fitted", "sensor", "volume_95", "budget",
        "errors", "conversions", "sections", "corrected_scale", "thermal_scale", "scan_centre",
    ),
)  # fmt: skip
def collect_result(engine: Engine, state: JobState) -> Result:
    """Puts the result together. Raises the first failure where there are failures and no site."""
    if state.failures and not state.found:
        raise state.failures[0]
    part, scan, deviation = state.part, state.scan, state.deviation
    sites = tuple(_describe_site(site, state.field) for site in state.found)
    label = np.zeros(len(scan.points), np.int32)
    for site in sites:
        label[site.points] = site.id
    kept = deviation.label.copy()
    kept[(kept == DAMAGE) & (state.sites.label == 0)] = OUTLIER
    for item in state.surplus:  # those of surroundings are outliers until here
        kept[item.points] = ADDED
    origin = part.bounds.mean(axis=0)
    accepted = [site.damage for site in sites if site.accepted]
    lost = unite(accepted, origin)
    damage = to_solid(lost, origin)
    # a cut-back is no damage: what was found is compared as it was found
    cut_back = any(site.damage is not found.damage for site, found in zip(sites, state.found, strict=True))
    taken = (site.damage for site in state.found if site.accepted)
    found = to_solid(unite(taken, origin), origin) if cut_back else damage
    alone = sum(site.damage.volume for site in state.found if site.accepted)
    return Result(
        name=state.name,
        units=state.unit,
        tolerance=state.tolerance,
        part=part,
        scan=scan,
        aligned=state.aligned,
        pose=state.pose,
        deviation=replace(deviation, label=kept),
        site_label=label,
        sites=sites,
        damage=damage,
        undamaged=subtract_from_part(part, accepted, lost),
        warnings=rank_notes((*state.warnings, *_note_unused(engine), *make_notes("renamed", engine.job.notes))),
        failures=tuple(str(error) for error in state.failures),
        truth=_compare_with_truth(found, scan, state.pose, state.tolerance, state.adapted is not None),
        stages=tuple(engine.records),
        steps=tuple(engine.steps),
        coverage=state.coverage,
        surplus=state.surplus,
        adapted=state.adapted,
        fit=None if state.fitted is None else state.fitted.fit,
        sensor=state.sensor,
        budget=state.budget,
        not_in_budget=tuple(UNKNOWN[name] for name in state.errors.scanner.unknown),
        certificate=state.errors.scanner.certificate,
        conversions={"dict": to_dict, **state.conversions},
        sections=state.sections,
        scan_factor=state.thermal_scale * state.corrected_scale,
        scan_centre=state.scan_centre,
        volume_95=shift_interval(state.volume_95, (damage.volume if damage else 0.0) - alone),
    )


def _note_unused(engine: Engine) -> Reasons:
    """Names stage `sample` where the job changes it and nothing took its points."""
    stage, usual = engine.job.stages[Sample], engine.registry.get(Sample.stage, DEFAULTS[Sample])
    is_used = Sample in engine.job.given or any(record.stage == Sample.stage for record in engine.records)
    if is_used or (stage.use == usual.name and stage == usual.cls.model_validate({})):
        return ()
    return make_notes(Sample.stage, (f"sample: {stage.use} did not run: no stage uses its points",))


def _describe_site(found: FoundSite, field: ScanField) -> Site:
    evidence, members = found.evidence, found.members
    warnings = make_notes("enclose", found.notes)
    deposit, damage, enclosures = found.deposit, found.damage, found.enclosures
    if isinstance(deposit, Deposit):
        if deposit.milled is None and deposit.cavity is not None:
            damage = deposit.cavity
            enclosures = () if deposit.opening is None else (deposit.opening,)
        warnings += make_notes("allowance", deposit.notes)
    path = found.path
    if path is not None:
        warnings += make_notes("path", path.notes)
    return Site(
        id=found.number,
        clusters=found.clusters,
        points=members,
        damage=damage,
        surface=extract_ids(damage, field.part),
        deposit=deposit,
        refused=found.refused,
        verdict=found.verdict,
        accepted=found.accepted,
        uncertainty=shift_uncertainty(found.uncertainty, damage.volume - found.damage.volume),
        volume_rates=tuple(one.rate for one in found.dependences),
        enclosures=enclosures,
        path=path,
        method=found.method,
        evidence=evidence,
        max_depth=found.measure_depth(field),
        warnings=warnings,
    )


def _compare_with_truth(
    damage: Solid | None, scan: Scan, pose: Pose, tolerance: float, is_adapted: bool
) -> Floats | None:
    """(volume, IoU) against a virtual scan's known damage. On a symmetric part any of the poses that map it onto itself
    is right, so where the pose found is another one, the truth is moved by the difference. ``is_adapted``: the damage
    is that of the deformed part, and its truth too."""
    if scan.truth is None:
        return None
    deformed = scan.truth.deformed if is_adapted else None
    truth = deformed or scan.truth.damage
    if truth is None:
        return np.array([0.0, iou(None, damage)])
    D = pose.T_part_scan @ np.linalg.inv(scan.truth.T_part_scan)
    moved = move_points(truth.vertices, D)
    if deformed or np.linalg.norm(moved - truth.vertices, axis=1).max() > 5 * tolerance:
        truth = Solid(moved, truth.faces)
    return np.array([truth.volume, iou(truth, damage)])
