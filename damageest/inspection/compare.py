"""Compares a scan made after a step of a repair with the target of the step.

The part as it is to be takes the place of the part as designed in a run: losses are what is missing, surplus is what is
over. So coverage, evidence and intervals are those of every run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from damageest.api import run
from damageest.artefacts import Flags
from damageest.errors import InputError
from damageest.inspection.aim import Aim
from damageest.inspection.discrepancies import Finding, list_findings
from damageest.inspection.joined import find_bodies, keep_joined, list_joined
from damageest.inspection.places import cut_places, land_points
from damageest.inspection.verdicts import Verdict, WholeVerdict, judge_site, judge_whole
from damageest.result import Result
from damageest.rules.notes import merge_notes

NEAR = 3.0
"""Distance from a deposit, in tolerances, within which skin does not tell how well the scan fits."""
OWN = 0.5
"""Distance from a deposit, in tolerances, within which skin is finished skin of its site."""
DEFECT = 15.0
"""Width of the least defect that matters, in tolerances, where nobody says it."""


@dataclass(frozen=True)
class Question:
    """The settings of an inspection. ``tolerance``: None: that of the run before. ``same_setup``: the part was not
    moved between the scans, and has the pose of the first one. ``defect``: width of the least defect that matters;
    None: `DEFECT` tolerances. ``elsewhere``: whether what is found at no site decides on the part, or is only listed.
    ``fixtures``: boxes in the part's frame, with ``min`` and ``max``, in which points are no part's. ``scan_unit``: of
    the file; None: as in the job. ``part_temperature``: at this scan, in °C; None: as in the job.
    """

    tolerance: float | None = None
    same_setup: bool = False
    defect: float | None = None
    elsewhere: Literal["decides", "listed"] = "decides"
    fixtures: tuple[Mapping[str, Any], ...] = ()
    scan_unit: str | None = None
    part_temperature: float | None = None


@dataclass(frozen=True)
class Inspection:
    """What a scan after a step shows. ``whole``: of the part. ``defect``: width of the least defect that matters.
    ``pose``: how the scan was laid on the part; ``off``: root mean square of its distance from skin that was not
    repaired."""

    findings: tuple[Finding, ...]
    verdicts: tuple[Verdict, ...]
    whole: WholeVerdict
    pose: str
    off: float
    notes: tuple[str, ...]
    tolerance: float
    defect: float
    result: Result


def ask(aim: Aim, asked: Mapping[str, Any]) -> Question:
    """The settings: ``asked`` first, then those of the job of the earlier run."""
    of_job = aim.folder.content["provenance"]["job"].get("inspect") or {}
    told: dict[str, Any] = {**of_job, **_leave_out_none(asked)}
    known = {field.name for field in fields(Question)}
    taken: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in told.items() if name in known
    }
    return Question(**taken)


def _leave_out_none(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def inspect_step(aim: Aim, scan: Path, question: Question = Question()) -> Inspection:
    """Compares the scan with the aim.

    Raises InputError and StageError as a run does.
    """
    content = aim.folder.content
    allowed = question.tolerance or float(content["tolerance"])
    defect = question.defect or DEFECT * allowed
    align, pose = _choose_pose(content, question.same_setup)
    job: dict[str, Any] = {
        "version": 1, "name": content["name"], "units": aim.folder.unit, "tolerance": allowed, "align": align,
        "adapt": "none", "accept": "all", "scan": _choose_reading(content, scan, question), "report": "none",
        **_choose_temperature(content, question),
    }  # fmt: skip
    result = run(job, part=aim.target)
    places = {number: cut_places(aim.target, body, OWN * allowed, defect) for number, body in aim.deposits.items()}
    bodies = find_bodies(result)
    fixed = _find_fixed(result, question.fixtures)
    counted = np.flatnonzero(~fixed)
    points, distance = result.aligned.points[counted], result.deviation.distance[counted]
    landed = {
        number: keep_joined(replace(one, index=counted[one.index]), bodies, allowed, float(result.scan.spacing))
        for number, own in places.items()
        if own is not None
        for one in (land_points(own, aim.target, points, distance),)
    }
    joined, told = list_joined(result, bodies, places, landed)
    findings = (*list_findings(aim, result, landed, fixed), *joined)
    unit, noise = result.units, float(result.aligned.noise)
    verdicts = tuple(
        judge_site(number, own, landed.get(number), findings, allowed, noise, unit) for number, own in places.items()
    )
    whole = judge_whole(verdicts, findings, question.elsewhere, unit)
    off = _measure_fit(aim, result)
    return Inspection(findings, verdicts, whole, pose, off, (*told, *_list_notes(result)), allowed, defect, result)


def _find_fixed(result: Result, fixtures: tuple[Mapping[str, Any], ...]) -> Flags:
    """Which points of the scan (N,) lie in fixtures that the job names."""
    points = result.aligned.points
    inside = np.zeros(len(points), bool)
    for box in fixtures:
        inside |= ((points >= np.array(box["min"])) & (points <= np.array(box["max"]))).all(axis=1)
    return inside


def _choose_reading(content: Mapping[str, Any], scan: Path, question: Question) -> dict[str, Any]:
    """The options of `scan`: the file is read as that of the job was."""
    asked = content["provenance"]["job"].get("scan")
    asked = asked if isinstance(asked, Mapping) and asked.get("use", "file") == "file" else {}
    reading = {"use": "file", "path": str(scan.absolute())}
    crops = ["crop"] if question.same_setup else []  # they are in the frame of the scanner
    kept = ["unit", "columns", "min_confidence", *crops]
    reading |= {name: asked[name] for name in kept if asked.get(name)}
    if question.scan_unit:
        reading["unit"] = question.scan_unit
    return reading


def _choose_temperature(content: Mapping[str, Any], question: Question) -> dict[str, Any]:
    """The option `temperature`, where the job has one. Raises InputError for a temperature without an expansion."""
    asked = content["provenance"]["job"].get("temperature")
    if asked is None:
        if question.part_temperature is not None:
            raise InputError("--part-temperature: the job gives no expansion of the material; add  temperature  to it")
        return {}
    if question.part_temperature is not None:
        asked = {**asked, "part": question.part_temperature}
    return {"temperature": dict(asked)}


def _choose_pose(content: Mapping[str, Any], same_setup: bool) -> tuple[Any, str]:
    """The options of `align`, and in words what the pose is from."""
    if same_setup:
        transform = content["alignment"]["transform"]
        return {"use": "none", "T_part_scan": transform}, "of the scan before: the part was not moved"
    asked = content["provenance"]["job"].get("align") or {}
    if isinstance(asked, Mapping) and asked.get("datum"):
        return dict(asked), "fitted to the datums of the job"
    return "register", "fitted to the skin; deviating repaired places have as little weight as damage"


def _list_notes(result: Result) -> tuple[str, ...]:
    """The notes of the run. Nobody looks for a displaced piece in a part that was built up."""
    return tuple(str(note) for note in merge_notes(result.warnings) if note.code not in ("displaced_piece", "cluster"))


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
