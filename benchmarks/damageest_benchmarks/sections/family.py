"""Shafts with lobes, wear on one side, flats and grooves, seen all around or on an arc; and what their section says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.geometry.solids import to_solid

DRAWS = 60
HEIGHT, TOLERANCE = 20.0, 0.1
WIDE = 2.5
"""Standard uncertainties within which a value is right."""
KINDS = ("round", "lobes", "worn on one side", "lobes, on an arc", "worn, on an arc", "groove")


@dataclass(frozen=True)
class Shaft:
    """A shaft of nominal ``radius`` with ``points`` (N,3), ``noise`` and ``spacing``; ``diameter``: that of the
    least-squares circle of its form, all around. Wear on an arc has its middle where the scan shows it."""

    kind: str
    radius: float
    points: Floats
    noise: float
    spacing: float
    diameter: float


def draw_shaft(seed: int) -> Shaft:
    """A shaft of the family."""
    rng = np.random.default_rng([711, seed])
    kind, radius = KINDS[seed % len(KINDS)], float(rng.uniform(8, 25))
    noise, spacing = float(rng.uniform(0.005, 0.03)), float(rng.uniform(0.25, 0.7))
    number, height, phase = int(rng.integers(2, 7)), float(rng.uniform(0.02, 0.12)), float(rng.uniform(0, 2 * np.pi))
    off = rng.uniform(-0.1, 0.1, 2)
    half = float(rng.uniform(0.8, 1.5))

    def form(angle: Floats) -> Floats:
        """How far the surface is outside the nominal radius."""
        away = np.abs((angle - phase + np.pi) % (2 * np.pi) - np.pi)
        if "lobes" in kind:
            return np.asarray(height * np.cos(number * (angle - phase)))
        if "worn" in kind:
            return np.asarray(-3 * height * np.cos(np.pi / 2 * np.minimum(away / half, 1)) ** 2)
        if kind == "groove":
            return np.asarray(-1.0 * (away < 0.1))
        return np.zeros(len(angle))

    arc = 2 * np.pi if "arc" not in kind else float(rng.uniform(3.6, 5.2))
    if "worn" in kind:
        phase = float(rng.uniform(0, arc))
    count = int(arc * radius * HEIGHT / spacing**2)
    angle, z = rng.uniform(0, arc, count), rng.uniform(-HEIGHT / 2, HEIGHT / 2, count)
    size = radius + form(angle) + rng.normal(0, noise, count)
    points = np.stack([off[0] + size * np.cos(angle), off[1] + size * np.sin(angle), z], axis=1)
    around = np.arange(7200) * 2 * np.pi / 7200
    kept = form(around) > -0.9 if kind == "groove" else np.ones(len(around), bool)
    at = (radius + form(around))[kept, None] * np.stack([np.cos(around), np.sin(around)], axis=1)[kept]
    return Shaft(kind, radius, points, noise, spacing, 2 * _fit(at))


def _fit(at: Floats) -> float:
    """Radius of the least-squares circle through places (N,2), by Gauss and Newton."""
    x = np.array([*at.mean(axis=0), np.linalg.norm(at - at.mean(axis=0), axis=1).mean()])
    for _ in range(20):
        away = at - x[:2]
        size = np.linalg.norm(away, axis=1)
        rows = np.column_stack([away / size[:, None], np.ones(len(at))])
        x = x + np.linalg.lstsq(rows, size - x[2], rcond=None)[0]
    return float(x[2])


def measure_shaft(seed: int) -> dict[str, Any]:
    """What a section across the middle of a shaft says of its diameter."""
    from manifold3d import Manifold

    from damageest.job.sections import SectionChoice
    from damageest.sections.measure import Scanned, measure_sections

    shaft = draw_shaft(seed)
    solid = to_solid(Manifold.cylinder(HEIGHT, shaft.radius, shaft.radius, 256, True), np.zeros(3))
    assert solid is not None
    part = Part(solid.vertices, solid.faces, unit="mm")
    (section,) = measure_sections(
        [SectionChoice.model_validate({"z": 0.4})], part, Scanned(shaft.points, shaft.spacing, shaft.noise), TOLERANCE
    )
    found = section.value("diameter")
    row = {"seed": seed, "kind": shaft.kind, "true": shaft.diameter, "measured": found.measured, "error": found.error}
    if found.measured is None or not found.error:
        return row | {"off": None, "right": False}
    off = (found.measured - shaft.diameter) / found.error
    return row | {"off": float(off), "right": bool(abs(off) <= WIDE)}


def make_sections_table(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Head and body of the table: a line for each kind, and one for all."""
    groups = {kind: [row for row in rows if row["kind"] == kind] for kind in KINDS} | {"all": list(rows)}
    head = ["form", "sections", f"within {WIDE} uncertainties", "standard uncertainty, median", "error, median"]
    body = []
    for name, group in groups.items():
        known = [row for row in group if row["off"] is not None]
        spread = float(np.median([row["error"] for row in known])) if known else float("nan")
        off = float(np.median([abs(row["measured"] - row["true"]) for row in known])) if known else float("nan")
        body.append([name, str(len(group)), str(sum(row["right"] for row in group)), f"{spread:.4f}", f"{off:.4f}"])
    return [head, *(line for line in body if line[1] != "0")]
