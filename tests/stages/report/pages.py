"""Reports of small results, written once for all tests of a process."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import damageest
from damageest.artefacts import DAMAGE, AdaptedPart, Deviation, Reason, Scan
from damageest.findings import Sensor, Verdict
from damageest.geometry.distance import signed_distance
from damageest.geometry.sampling import sample_by_area
from damageest.output.files import describe_result
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.report.html import Html
from tests.stages.export.results import make

JOBS = Path(__file__).parents[3] / "jobs"
NASTY = '<img src=x onerror="document.title=1">&"\'</script><script>document.title=2</script>'
"""Would run where it is not escaped."""


@cache
def two_sites(count: int = 12_000) -> Result:
    """The box with two bites, with a scan of it of ``count`` points."""
    plain = make()
    assert plain.undamaged is not None
    points = sample_by_area(plain.undamaged, count, np.random.default_rng(0))[0]
    points += np.random.default_rng(1).normal(0, 0.02, points.shape)
    distance, face = signed_distance(points, plain.part)
    label = np.where(distance < -3 * plain.tolerance, DAMAGE, 0).astype(np.uint8)
    near = [np.linalg.norm(points - site.centroid, axis=1) for site in plain.sites]
    number = np.where(label == DAMAGE, 1 + np.argmin(near, axis=0), 0).astype(np.int32)
    scan = Scan(points, noise=0.02, spacing=0.5)
    sites = tuple(replace(site, points=np.flatnonzero(number == site.id)) for site in plain.sites)
    sites = (
        sites[0],
        replace(
            sites[1],
            verdict=Verdict("likely", (Reason("beside", "a part of its rim was not seen", "open", 1.0, "mm³"),)),
        ),
    )
    sensor = Sensor(0.02, 0.01, 5.0, 0.0, 0.0, 2 * plain.tolerance, 1.0)
    return replace(
        plain, scan=scan, aligned=scan, deviation=Deviation(distance, face, label), site_label=number, sites=sites,
        sensor=sensor,
    )  # fmt: skip


@cache
def sheared(amount: float = 0.4) -> Result:
    """The same on a part of which one end is higher by an amount, and the other lower."""
    plain = two_sites()
    low, high = plain.part.bounds
    share = (2 * plain.part.vertices[:, :1] - (low + high)[0]) / (high - low)[0]
    moved = amount * share * np.array([0.0, 0.0, 1.0])
    part = replace(plain.part, vertices=plain.part.vertices + moved)
    adapted = AdaptedPart(part, moved, np.eye(4), np.zeros((0, *moved.shape)), amount, amount / 2)
    return replace(plain, part=part, adapted=adapted)


def twelve_sites(folder: Path) -> Path:
    """Runs a job with twelve damages, and gives its report's path."""
    tools: list[dict[str, object]] = []
    for k in range(12):
        centre = [-52 + 34 * (k // 3), -33 + 33 * (k % 3), 0]
        tools.append({"tool": "sphere", "centre": centre, "radius": 5 + 0.2 * k})
    scan = {"use": "simulate", "points": 100_000, "noise": 0.06, "damage": tools}
    job = {"version": 1, "tolerance": 0.3, "part": str(JOBS / "parts/ribbed_plate.stl"), "align": "none", "scan": scan}
    (folder / "twelve.yaml").write_text(json.dumps(job))
    damageest.run(folder / "twelve.yaml", output=folder / "out")
    return folder / "out/report.html"


def write(
    result: Result, folder: Path | None = None, job_text: str = "version: 1\n", stage: Html | None = None
) -> Path:
    """Writes the report of a result; gives its path."""
    folder = folder or Path(mkdtemp(prefix="damageest-report-"))
    folder.mkdir(parents=True, exist_ok=True)
    names = tuple(f"{kind}/site-{site.id}.stl" for site in result.sites for kind in ("damage", "surface", "deposit"))
    content = describe_result(result, folder, ExportedFiles(names))
    (stage or Html()).run(result, folder, content, job_text)
    return folder / "report.html"
