"""What happens between stages: the values that follow from an artefact, and the turns from job to sites and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import INTACT, OUTLIER, Deviation, Enclosures, Part, Scan, Sites
from damageest.cache import digest
from damageest.contracts import DEFAULTS, Contract
from damageest.engine import Engine, Joint, Route, State, follow
from damageest.errors import InputError, StageError
from damageest.job import load
from damageest.measure import measure
from damageest.registry import Registry
from damageest.result import Result, Site
from damageest.settle import settle
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.units import diagnose_scale

AUTO_TOLERANCE = 4.0
"""Lambda over the scan's noise where the job says auto: 6 in 100,000 sound points deviate by more."""


def measured(engine: Engine, lanes: list[State]) -> list[State]:
    """Measures the scan's noise and spacing, settles the tolerance, and refuses a scan of another size."""
    (state,) = lanes
    scan, part = state["scan"], state["part"]
    if wrong_size := diagnose_scale(scan.points, part.bounds):
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


def each_cluster(engine: Engine, lanes: list[State]) -> list[State]:
    """From the job to its sites: one lane for each cluster of points."""
    (state,) = lanes
    aligned, deviation, sites = state["aligned"], state["deviation"], state["sites"]
    state = state.derive("intact", aligned.points[deviation.label == INTACT], "aligned", "deviation")
    sources = ("aligned", "sites")
    return [
        state.at(k).derive("points", aligned.points[sites.members(k)], *sources).derive("clusters", (k,), *sources)
        for k in range(1, sites.count + 1)
    ]


def each_enclosure(engine: Engine, lanes: list[State]) -> list[State]:
    """From the job to one lane for each enclosure."""
    (state,) = lanes
    enclosures: Enclosures = state["enclosures"]
    return [
        state.at(k).derive("solid", item.solid, "enclosures").derive("clusters", item.sites, "enclosures")
        for k, item in enumerate(enclosures.items, 1)
    ]
