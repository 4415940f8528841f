"""Certificate and temperature through the whole route: each sensitivity is what a scan with that error shows."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

import damageest
from damageest.artefacts import Floats, Part, Scan
from damageest.cli import app
from damageest.findings import Budget, BudgetRow
from damageest.geometry.solids import to_manifold, to_solid
from damageest.registry import Registry
from damageest.result import Result, Site
from tests import damaged_box
from tests.pipeline.halfway import Halfway, run_until

NOISE, TOLERANCE = 0.01, 0.25
CERTIFICATE = {
    "probing_form": 0.08,
    "probing_size": 0.02,
    "length": "0.01 + L/5000",
    "k": 2,
    "standard": "ISO 10360-13",
}
WARM = {"part": 120, "uncertainty": 2, "expansion": 24e-6, "expansion_uncertainty": 1e-6}
GIVEN = {"scanner": {"name": "S1", "certificate": CERTIFICATE}, "temperature": {**WARM, "part": 20}}


SIZE = np.array([20.0, 15.0, 10.0])


def make_box() -> Part:
    mesh = trimesh.creation.box(SIZE)
    return Part(mesh.vertices, mesh.faces)


@cache
def sample_damaged() -> tuple[Floats, Floats]:
    """Points of the box with a hollow in an edge, and the outward normals of the metal."""
    tool = trimesh.creation.icosphere(5, 5.0).apply_translation([-9.0, 0.0, 6.0])
    metal = to_solid(to_manifold(make_box()) - to_manifold(tool))
    assert metal is not None
    mesh = trimesh.Trimesh(metal.vertices, metal.faces, process=False)
    points, face = trimesh.sample.sample_surface(mesh, 6000, seed=1)
    return np.asarray(points), np.asarray(mesh.face_normals[face])


def make_scan(offset: float = 0.0, scale: float = 1.0, noise: float = NOISE) -> Scan:
    """Points that lie outside by ``offset``, scaled about the middle of the part."""
    points, normals = sample_damaged()
    points = scale * (points + offset * normals)
    return Scan(points + np.random.default_rng(0).normal(scale=noise, size=points.shape))


@cache
def run(align: str, offset: float = 0.0, scale: float = 1.0, more: str = "{}") -> Result:
    aligned = {"use": "icp", "datum": DATUMS} if align == "datums" else align
    job = {
        "version": 1,
        "tolerance": TOLERANCE,
        "report": "none",
        "align": aligned,
        "adapt": "none",
        **json.loads(more),
    }
    return damageest.run(job, part=make_box(), scan=make_scan(offset, scale))


def run_until_weighed(
    registry: Registry, scale: float = 1.0, step: str = "measure_scan_errors", **more: Any
) -> Halfway:
    job = {"tolerance": TOLERANCE, "align": "none", "adapt": "none", **more}
    return run_until(step, make_box(), make_scan(scale=scale), registry, **job)


@pytest.fixture(scope="module")
def plain(registry: Registry) -> Halfway:
    """Before what is known of the scanner is weighed. The part is at 20 degrees: its temperature changes nothing."""
    return run_until_weighed(registry)


def find_row(budget: Budget | None, source: str) -> BudgetRow:
    assert budget is not None
    return next(row for row in budget.rows if row.source == source)


DATUMS = [
    {"box": [[-11, -8, -5.01], [11, 8, -4.99]]},
    {"box": [[-11, -7.51, -6], [11, -7.49, 6]]},
    {"box": [[9.99, -8, -6], [10.01, 8, 6]]},
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("align", "source", "offset", "scale"),
    [
        ("none", "probing_size", 0.03, 1.0),
        pytest.param("icp", "probing_size", 0.03, 1.0, marks=pytest.mark.slow),
        pytest.param("icp", "length", 0.0, 1.005, marks=pytest.mark.slow),
        pytest.param("datums", "probing_size", 0.02, 1.0, marks=pytest.mark.slow),
    ],
)
def test_a_sensitivity_is_what_a_scan_with_that_error_shows(
    align: str, source: str, offset: float, scale: float, plain: Halfway
) -> None:
    given = json.dumps(GIVEN)
    before = plain.finish(**GIVEN) if align == "none" else run(align, more=given)
    after = run(align, offset, scale, given)
    size = 2 * offset if offset else scale - 1
    expected = find_row(before.budget, source).sensitivity * size
    assert after.damage_volume - before.damage_volume == pytest.approx(expected, abs=0.45)
    (one,), (other,) = before.sites, after.sites
    assert one.uncertainty is not None
    deeper = find_row(one.uncertainty.depth_budget, source).sensitivity * size
    assert find_depth(other) - find_depth(one) == pytest.approx(deeper, abs=0.02)


def find_depth(site: Site) -> float:
    """The depth that the interval is about: its low end and the expanded uncertainty."""
    assert site.uncertainty is not None
    assert site.uncertainty.depth_budget is not None
    assert site.depth_95 is not None
    return site.depth_95[0] + site.uncertainty.depth_budget.expanded


@pytest.mark.slow
def test_a_warm_part_is_brought_to_20_degrees(plain: Halfway) -> None:
    scale = 1 + WARM["expansion"] * (WARM["part"] - 20)
    right = plain.finish().damage_volume
    warm = run("none", scale=scale, more=json.dumps({"temperature": WARM}))
    assert warm.damage_volume == pytest.approx(right, abs=0.05)
    assert warm.scan.points == pytest.approx(sample_damaged()[0], abs=6 * NOISE)
    assert {row.source for row in warm.budget.rows} >= {"temperature", "expansion"}  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_wrong_scale_is_named(registry: Registry) -> None:
    told = {"certificate": {"length": 0.005, "k": 2}}
    cold = run_until_weighed(registry, 1.004, "measure_uncertainty", scanner=told)
    (note,) = [note for note in cold.state.warnings if note.code == "certificate"]
    assert note.amount == pytest.approx(0.4, abs=0.05)


@pytest.mark.slow
def test_what_the_job_does_not_tell_is_named(plain: Halfway) -> None:
    assert len(plain.finish().not_in_budget) == 4
    assert plain.finish(**GIVEN).not_in_budget == ()
    some = plain.finish(scanner={"certificate": {"probing_size": 0.02}})
    assert "probing size error" not in some.not_in_budget
    assert "probing form error" in some.not_in_budget


def test_noise_far_above_the_probing_form_error_contradicts_the_certificate(plain: Halfway) -> None:
    fine = plain.finish(scanner={"certificate": {"probing_form": 0.02}})
    assert [note.code for note in fine.warnings if note.code == "certificate"] == ["certificate"]
    assert not [note for note in plain.finish(**GIVEN).warnings if note.code == "certificate"]


def test_a_certificate_widens_the_interval_and_the_interval_is_twice_the_budget(plain: Halfway) -> None:
    alone, certified = plain.finish(), plain.finish(**GIVEN)
    for result in (alone, certified):
        assert result.budget is not None
        assert result.volume_95 is not None
        low, high = result.volume_95
        up = sum(bound.high for bound in result.budget.bounds)
        down = sum(bound.low for bound in result.budget.bounds)
        middle = result.damage_volume + result.budget.correction
        assert (low, high) == pytest.approx(
            (middle - result.budget.expanded + down, middle + result.budget.expanded + up)
        )
    assert certified.budget.expanded > alone.budget.expanded  # type: ignore[union-attr]


CERTIFIED = "scanner:\n  certificate: {probing_form: 0.2, length: 0.01 + L/5000}\n"


@pytest.mark.slow
def test_result_json_and_the_table_have_the_budget(small_done: Path) -> None:
    small_done.write_text(small_done.read_text() + CERTIFIED)
    done = CliRunner().invoke(app, ["run", str(small_done)])
    assert done.exit_code == 0, done.output
    assert "probing size error" not in done.output, "what the job leaves out stands once, in the report"
    told = json.loads((small_done.parent / "out/job/result.json").read_text())
    assert told["budget"]["expanded"] == pytest.approx(2 * told["budget"]["combined"])
    assert told["sites"][0]["uncertainty"]["depth_budget"]["rows"]
    assert told["not_in_budget"] == ["probing size error", "temperature of the part"]
    assert {"probing_form", "length"} <= {row["source"] for row in told["budget"]["rows"]}


@pytest.mark.slow
def test_the_report_has_the_budget(small_done: Path, registry: Registry) -> None:
    small_done.write_text(small_done.read_text().replace("report: none\n", "") + CERTIFIED)
    damageest.run(small_done, output=True, registry=registry)
    page = (small_done.parent / "out/job/report.html").read_text()
    assert "length measurement error" in page
    assert "probing size error, temperature of the part" in page


def test_a_wrong_formula_is_a_fault_of_its_line(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path, damaged_box.JOB + "scanner:\n  certificate:\n    length: 0.02 - L/3\n", 60)
    done = CliRunner().invoke(app, ["validate", str(path)])
    assert done.exit_code == 2
    assert "job.yaml:9" in done.output
    assert "no number" in done.output
