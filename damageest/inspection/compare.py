"""Compares a scan made after a step of a repair with what the step was to give.

The part as it is to be takes the place of the part as designed in a run: losses are what is missing, surplus is what is
over. So coverage, evidence and intervals are those of every run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from damageest.api import run
from damageest.artefacts import Flags, Floats, Solid, Vector
from damageest.geometry.distance import distance_to_mesh, signed_distance
from damageest.geometry.solids import to_manifold
from damageest.inspection.aim import Aim, cut_volume
from damageest.result import Result
from damageest.rules.notes import fold_notes

ELSEWHERE = 0
"""Number of the site that stands for the rest of the part."""
NEAR = 3.0
"""Distance from a deposit, in tolerances, within which a place belongs to it."""
SHOWN = 0.98
"""Share of a repaired place's skin that the scan has to show for its tolerance to be met."""
Outcome = Literal["met", "not met", "not shown"]


@dataclass(frozen=True)
class Finding:
    """``kind``: "missing": metal as designed that is not there; "stock short": stock that is not there; "over": metal
    beyond what was to be. ``site``: of the repair, 0 elsewhere. ``volume`` with its 95 % interval, None where there is
    none. ``depth``: largest distance from where the surface was to be. ``level``: what the volume is worth."""

    kind: Literal["missing", "stock short", "over"]
    site: int
    volume: float
    low: float | None
    high: float | None
    depth: float
    centre: Vector
    level: str


@dataclass(frozen=True)
class Verdict:
    """Whether a repaired place is within the tolerance, and why not. ``lowest`` and ``highest``: mean deviation of the
    cells of its skin that deviate most; None where the scan shows none."""

    site: int
    outcome: Outcome
    why: str
    seen: float
    lowest: float | None
    highest: float | None


@dataclass(frozen=True)
class Inspection:
    """What a scan after a step shows. ``pose``: how it was laid on the part; ``off``: root mean square of its distance
    from skin that was not repaired."""

    findings: tuple[Finding, ...]
    verdicts: tuple[Verdict, ...]
    pose: str
    off: float
    notes: tuple[str, ...]
    tolerance: float
    result: Result


def inspect_step(aim: Aim, scan: Path, tolerance: float | None = None, same_setup: bool = False) -> Inspection:
    """Compares the scan with the aim. ``tolerance``: None: that of the run before. ``same_setup``: the part was not
    moved between the scans, and has the pose of the first one.

    Raises InputError and StageError as a run does.
    """
    content = aim.folder.content
    allowed = tolerance or float(content["tolerance"])
    align, pose = _choose_pose(content, same_setup)
    job: dict[str, Any] = {
        "version": 1, "name": content["name"], "units": aim.folder.unit, "tolerance": allowed, "align": align,
        "adapt": "none", "accept": "all", "scan": {"use": "file", "path": str(scan.absolute())}, "report": "none",
    }  # fmt: skip
    result = run(job, part=aim.target)
    findings = (*_list_missing(aim, result), *_list_over(aim, result))
    verdicts = tuple(_judge(aim, result, number, findings) for number in aim.deposits)
    return Inspection(findings, verdicts, pose, _measure_fit(aim, result), _list_notes(result), allowed, result)


def _choose_pose(content: Mapping[str, Any], same_setup: bool) -> tuple[Any, str]:
    """The options of `align`, and in words what the pose is from."""
    if same_setup:
        transform = content["alignment"]["transform"]
        return {"use": "none", "T_part_scan": transform}, "that of the scan before: the part was not moved"
    asked = content["provenance"]["job"].get("align") or {}
    if isinstance(asked, Mapping) and asked.get("datum"):
        return dict(asked), "fitted to the datums of the job"
    return "register", "fitted to the skin; repaired places that deviate pull as little as damage does"


def _list_missing(aim: Aim, result: Result) -> list[Finding]:
    found = []
    whole = to_manifold(aim.nominal)
    for site in result.sites:
        below = cut_volume(site.damage, whole)
        above = max(site.damage.volume - below, 0.0)
        number = _find_site(aim, site.damage.vertices, result.tolerance)
        interval = site.volume_95
        low, high = (None, None) if interval is None else interval
        total = below + above
        at = _to_vector(site.centroid)
        kinds: tuple[tuple[Literal["missing", "stock short"], float], ...] = (
            ("missing", below),
            ("stock short", above),
        )
        for kind, volume in kinds:
            if volume > 0.02 * total:
                share = volume / total
                least, most = (None if end is None or not np.isfinite(end) else end * share for end in (low, high))
                found.append(Finding(kind, number, volume, least, most, site.max_depth, at, site.verdict.level))
    return found


def _list_over(aim: Aim, result: Result) -> list[Finding]:
    found = []
    for item in result.surplus:
        if item.kind == "surroundings":
            continue
        points = result.aligned.points[item.points]
        number = _find_site(aim, points, result.tolerance, float(item.height))
        at = _to_vector(points.mean(axis=0))
        volume = item.volume if item.volume is not None else item.estimate
        level = "likely" if item.solid is not None else "estimated"
        found.append(Finding("over", number, float(volume), None, None, float(item.height), at, level))
    return found


def _list_notes(result: Result) -> tuple[str, ...]:
    """The notes of the run. Nobody looks for a displaced piece in a part that was built up."""
    return tuple(str(note) for note in fold_notes(result.warnings) if note.code not in ("displaced_piece", "cluster"))


def _to_vector(values: Floats) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _find_site(aim: Aim, points: Floats, tolerance: float, height: float = 0.0) -> int:
    """The repaired place that points (N,3) lie at, or above by up to ``height``; `ELSEWHERE` where most are at none."""
    some = points[:: max(1, len(points) // 500)]
    shares = {
        number: float(_is_at(body, some, NEAR * tolerance + height).mean()) for number, body in aim.deposits.items()
    }
    best = max(shares, key=lambda number: shares[number])
    return best if shares[best] > 0.3 else ELSEWHERE


def _is_at(body: Solid, points: Floats, reach: float) -> Flags:
    return np.asarray((signed_distance(points, body)[0] < 0) | (distance_to_mesh(points, body) <= reach))


def _judge(aim: Aim, result: Result, number: int, findings: tuple[Finding, ...]) -> Verdict:
    """Whether a repaired place is within the tolerance."""
    coverage = result.coverage
    assert coverage is not None
    centres = coverage.skin.triangles.mean(axis=1)
    areas = np.linalg.norm(coverage.skin.cross, axis=1) / 2
    own = np.zeros(len(centres), bool)
    low, high = aim.deposits[number].bounds
    margin = result.tolerance
    near = np.flatnonzero(((centres > low - margin) & (centres < high + margin)).all(axis=1))
    if len(near):
        own[near] = distance_to_mesh(centres[near], aim.deposits[number]) <= 0.5 * result.tolerance
    if not own.any():
        return Verdict(number, "not shown", "the place has no skin of its own", 0.0, None, None)
    seen = float(areas[own & (coverage.is_seen | np.isfinite(coverage.distance))].sum() / areas[own].sum())
    distance = coverage.distance[own]
    known = distance[np.isfinite(distance)]
    ends = (float(known.min()), float(known.max())) if len(known) else (None, None)
    wrong = [one for one in findings if one.site == number]
    if wrong:
        kinds = [f"{one.kind} {one.volume:.4g} {result.units}³" for one in wrong]
        return Verdict(number, "not met", ", ".join(kinds), min(seen, 1.0), *ends)
    if seen < SHOWN:
        return Verdict(number, "not shown", f"the scan shows {100 * seen:.0f} % of it", seen, *ends)
    return Verdict(number, "met", "", min(seen, 1.0), *ends)


def _measure_fit(aim: Aim, result: Result) -> float:
    """Root mean square of the distance of intact points from skin that was not repaired."""
    points = result.aligned.points
    step = max(1, len(points) // 50_000)
    chosen = np.arange(0, len(points), step)
    away = np.ones(len(chosen), bool)
    for body in aim.deposits.values():
        low, high = body.bounds
        margin = NEAR * result.tolerance
        away &= ~((points[chosen] > low - margin) & (points[chosen] < high + margin)).all(axis=1)
    kept = result.deviation.distance[chosen[away]]
    kept = kept[np.abs(kept) <= result.tolerance]
    return float(np.sqrt((kept**2).mean())) if len(kept) else float("nan")
