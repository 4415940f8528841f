"""Part and scan of a job, read to be shown: as a run reads them, with their size, unit, points, spacing and noise."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest import read_inputs
from damageest.artefacts import Floats, Ints, Part, Scan
from damageest.geometry.crops import crop_points
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.units import diagnose_scale, diagnose_size, unit_factor
from damageest.job import Job, load
from damageest.registry import Registry
from damageest.stages.scan import ReadScan
from damageest_app.view.scene import thin
from damageest_app.view.shade import shade_points

UNITS = {"mm": "mm", "in": "inches", "cm": "cm", "m": "metres", "um": "micrometres", "ft": "feet"}
"""Units that are offered, the likeliest mistake first, with their names."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """``whole``: the scan as it was read; ``scan``: what crops leave of it; ``shown`` (M,): those of its points that
    the browser draws, and ``shade`` (M,), how bright they are. ``doubt``: why the unit is doubtful, empty where it is
    not; ``offers``: for `part` and `scan`, the units that would remove the doubt."""

    part: Part
    whole: Scan
    scan: Scan
    shown: Ints
    shade: Floats
    doubt: str
    offers: tuple[tuple[str, str], ...]

    def describe_part(self) -> str:
        size = " × ".join(f"{edge:.4g}" for edge in np.ptp(self.part.bounds, axis=0))
        faces = f", {len(set(self.part.faces_brep))} CAD faces" if self.part.faces_brep is not None else ""
        return (
            f"{size} {self.part.unit}, {self.part.volume:.5g} {self.part.unit}³, {len(self.part.faces)} triangles"
            + faces
        )

    def describe_scan(self) -> str:
        unit, points = self.scan.unit, self.scan.points
        size = " × ".join(f"{edge:.4g}" for edge in np.ptp(points, axis=0)) if len(points) else "0"
        count = f"{len(points):,} points"
        if self.scan.total > len(points):
            count += f" of {self.scan.total:,}"
        if len(self.whole.points) > len(points):
            count += f" ({len(self.whole.points) - len(points):,} cropped away)"
        return f"{size} {unit}, {count}, spacing {self.scan.spacing:.3g}, noise {self.scan.noise:.3g} {unit}"


class Reader:
    """Reads inputs, and keeps what was read last: another crop does not read the scan again."""

    def __init__(self, registry: Registry) -> None:
        self.registry = registry
        self._memo: dict[str, Any] = {}

    def check(self, path: Path) -> Job:
        """The job of a file. Raises JobError for one that is not valid."""
        return load(path, self.registry)

    def read(self, values: Mapping[str, Any], folder: Path) -> Inputs:
        """The inputs of a job, given as plain values, with paths relative to ``folder``. Raises DamageestError."""
        values = copy.deepcopy(dict(values))
        crops = load(values, self.registry, folder=folder).stages[ReadScan]
        if isinstance(values.get("scan"), dict):
            values["scan"].pop("crop", None)
        if len(self._memo) > 8:
            self._memo.clear()
        part, whole = read_inputs(load(values, self.registry, folder=folder), self.registry, self._memo)
        assert isinstance(crops, ReadScan)
        scan = self._measure(crop_points(whole, crops.crop) if crops.crop else whole)
        doubt = diagnose_scale(whole.points, part.vertices, part.unit) or diagnose_size(part.vertices, part.unit) or ""
        shown = thin(len(scan.points))
        shade = shade_points(scan.points[shown], None if scan.normals is None else scan.normals[shown])
        return Inputs(part, whole, scan, shown, shade, doubt, offer_units(part, whole) if doubt else ())

    def _measure(self, scan: Scan) -> Scan:
        if scan.noise or len(scan.points) < 10:
            return scan
        noise, spacing = measure_noise_and_spacing(scan.points)
        return replace(scan, noise=noise, spacing=spacing)


def offer_units(part: Part, scan: Scan) -> tuple[tuple[str, str], ...]:
    """The units of one of the two files with which the sizes agree, the closest first: (`part` or `scan`, unit)."""
    here = part.unit
    first = float(np.linalg.norm(np.ptp(scan.points, axis=0))) if len(scan.points) else 0.0
    if not first:
        return ()
    found = []
    for of in ("scan", "part"):
        for unit in UNITS:
            if unit == here:
                continue
            factor = unit_factor(unit, here)
            points = scan.points * (factor if of == "scan" else 1.0)
            vertices = part.vertices * (factor if of == "part" else 1.0)
            if diagnose_scale(points, vertices, here) is None and diagnose_size(vertices, here) is None:
                ratio = float(np.linalg.norm(np.ptp(points, axis=0)) / np.linalg.norm(np.ptp(vertices, axis=0)))
                found.append((round(abs(math.log(ratio)), 6), of, unit))
    return tuple((of, unit) for _, of, unit in sorted(found, key=lambda one: one[0])[:2])
