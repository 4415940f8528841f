"""Doubtful sites stay apart until the job accepts them; sites are dropped, merged and kept as the job says."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result as Answer
from typer.testing import CliRunner

import damageest
from damageest.artefacts import Floats, Scan
from damageest.cli import app
from damageest.errors import JobError, StageError
from damageest.io.meshes import write_points
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from tests.damaged_box import JOB, SIZE, box, write
from tests.pipeline.halfway import Halfway, run_until

TOP = SIZE[2] / 2
TOLERANCE = 0.2
DENTS = [
    {"tool": "sphere", "centre": [-12, 0, TOP], "radius": 4},
    {"tool": "sphere", "centre": [0, 0, TOP], "radius": 3.5},
    {"tool": "sphere", "centre": [12, 0, TOP], "radius": 3},
]


def scan_box(dents: int) -> Floats:
    scanner = Simulate.model_validate({"points": 25_000, "noise": 0.04, "damage": DENTS[:dents]})
    return np.asarray(scanner.run("mm", box()).points)


def make_strays(count: int) -> Floats:
    """Stray points under the top of the box, which has its own points above them."""
    rng = np.random.default_rng(3)
    place = rng.uniform([3.8, 7.8], [6.2, 10.2], (count, 2))
    return np.column_stack([place, rng.normal(TOP - 1.0, 0.04, count)])


def scan_with_strays(count: int, dents: int = 0) -> Floats:
    return np.concatenate([scan_box(dents), make_strays(count)])


def run(points: Floats, registry: Registry) -> Result:
    job = {"version": 1, "tolerance": TOLERANCE, "align": "none"}
    return damageest.run(job, part=box(), scan=points, registry=registry)


def levels(result: Result) -> list[str]:
    return [site.verdict.level for site in result.sites]


@pytest.fixture(scope="module")
def three_dents(registry: Registry) -> Halfway:
    """Before a person's decisions on the sites are followed."""
    points = scan_box(3)
    scan = Scan(points[points[:, 2] > 4.0])
    return run_until("choose_sites", box(), scan, registry, tolerance=TOLERANCE, align="none")


@pytest.fixture(scope="module")
def dent_and_strays(registry: Registry) -> Halfway:
    scan = Scan(scan_with_strays(60, dents=1))
    return run_until("choose_sites", box(), scan, registry, tolerance=TOLERANCE, align="none")


@pytest.mark.slow
@pytest.mark.parametrize("count", [pytest.param(4, marks=pytest.mark.slow), 16])
def test_a_few_stray_points_are_no_failure(count: int, registry: Registry) -> None:
    result = run(scan_with_strays(count), registry)
    assert result.status == "ok"
    assert result.damage is None


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 16])
def test_a_few_stray_points_beside_a_dent_are_no_failure(count: int, registry: Registry) -> None:
    beside = run(scan_with_strays(count, dents=1), registry)
    assert beside.status == "ok"
    assert levels(beside)[0] == "proven"
    assert beside.damage_volume == pytest.approx(2 / 3 * np.pi * 4**3, rel=0.03)


@pytest.mark.slow
def test_stray_points_under_intact_ones_are_doubtful_and_no_damage_unless_accepted(dent_and_strays: Halfway) -> None:
    result = dent_and_strays.finish()
    assert result.status == "ok"
    assert result.sites[0].damage.volume == pytest.approx(2 / 3 * np.pi * 4**3, rel=0.03)
    assert levels(result) == ["proven", "doubtful"]
    doubtful = result.sites[1]
    assert not doubtful.accepted
    assert doubtful.deposit is None
    assert result.damage_volume == pytest.approx(result.sites[0].damage.volume)
    accepted = dent_and_strays.finish(accept=[2])
    assert levels(accepted) == ["proven", "doubtful"]
    assert accepted.damage_volume == pytest.approx(sum(site.damage.volume for site in accepted.sites), rel=1e-6)
    assert dent_and_strays.finish(accept="all").damage_volume == accepted.damage_volume
    proven, likely = (dent_and_strays.finish(accept=least).damage_volume for least in ("proven", "likely"))
    assert proven == likely


@pytest.fixture(scope="module")
def doubted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Answer]:
    """A job whose only site is doubtful, with its output, and what the command said."""
    job = write(tmp_path_factory.mktemp("doubted"), points=60)
    x, y, z = scan_with_strays(60).T
    write_points(job.parent / "scan.ply", {"x": x, "y": y, "z": z})
    return job, CliRunner().invoke(app, ["run", str(job)])


def test_files_of_doubtful_sites_lie_apart_and_a_run_with_no_other_ends_with_1(doubted: tuple[Path, Answer]) -> None:
    job, done = doubted
    assert done.exit_code == 1
    assert "doubtful" in done.stdout
    assert "accept" in done.stderr
    out = job.parent / "out" / "job"
    report = json.loads((out / "result.json").read_text())
    (site,) = report["sites"]
    assert site["verdict"]["level"] == "doubtful"
    assert site["verdict"]["reasons"]
    assert site["files"]["damage"] == "doubtful/site-1.stl"
    assert (out / "doubtful" / "site-1.stl").is_file()
    assert not (out / "damage").exists()
    assert not (out / "damage.stl").exists()
    assert report["damage_volume"] == report["material"]["deposit_volume"] == 0


@pytest.mark.slow
def test_files_of_doubtful_sites_go_where_they_are_accepted(doubted: tuple[Path, Answer], tmp_path: Path) -> None:
    shutil.copytree(doubted[0].parent, tmp_path, dirs_exist_ok=True)
    job, out = tmp_path / "job.yaml", tmp_path / "out" / "job"
    report = json.loads((out / "result.json").read_text())
    report["export"]["files"] = []  # what is cleared away does not rest on this list
    (out / "result.json").write_text(json.dumps(report))
    job.write_text(JOB + "accept: all\n")
    assert CliRunner().invoke(app, ["run", str(job)]).exit_code == 0
    assert (out / "damage" / "site-1.stl").is_file()
    assert not (out / "doubtful").exists()


@pytest.fixture(scope="module")
def volumes(three_dents: Halfway) -> dict[int, float]:
    """Of each site without a decision."""
    return {site.id: site.damage.volume for site in three_dents.finish().sites}


def test_sites_are_dropped_under_the_same_numbers(three_dents: Halfway, volumes: dict[int, float]) -> None:
    assert list(volumes) == [1, 2, 3]
    dropped = three_dents.finish(sites={"drop": [2]})
    assert {site.id: site.damage.volume for site in dropped.sites} == {1: volumes[1], 3: volumes[3]}
    assert "site_dropped" in [note.code for note in dropped.warnings]


def test_sites_are_merged_under_the_same_numbers(three_dents: Halfway, volumes: dict[int, float]) -> None:
    merged = three_dents.finish(sites={"merge": [[3, 2]]})
    assert [site.id for site in merged.sites] == [1, 2]
    assert merged.sites[1].damage.volume == pytest.approx(volumes[2] + volumes[3], rel=1e-6)


def test_sites_are_kept_in_a_box_under_the_same_numbers(three_dents: Halfway) -> None:
    kept = three_dents.finish(sites={"keep": {"min": [-5, -5, 0], "max": [20, 5, 20]}})
    assert [site.id for site in kept.sites] == [2, 3]


@pytest.mark.parametrize("decision", [{"accept": [7]}, {"sites": {"drop": [7]}}, {"sites": {"merge": [[1, 7]]}}])
def test_an_unknown_number_is_named_with_the_known_ones(decision: dict[str, Any], three_dents: Halfway) -> None:
    with pytest.raises(StageError, match=r"site 7; there are: 1, 2, 3") as fault:
        three_dents.finish(**decision)
    assert fault.value.remedy


def test_a_wrong_decision_is_a_fault_of_the_job() -> None:
    with pytest.raises(JobError, match=r"sites|accept"):
        damageest.run({"version": 1, "sites": {"drop": [0]}, "accept": "some"}, part=box(), scan=np.eye(3))


def test_distances_that_are_no_numbers_are_refused() -> None:
    from damageest.artefacts import ArtefactError, Deviation

    with pytest.raises(ArtefactError, match="1 of 3 are not finite"):
        Deviation(np.array([0.0, np.nan, 1.0]), np.zeros(3, np.int64), np.zeros(3, np.uint8))


def test_a_scan_keeps_its_views() -> None:
    scan = Scan(np.eye(3), viewpoints=np.ones((2, 3)), view=np.array([0, 1, -1]))
    assert scan.take(np.array([2, 0])).view.tolist() == [-1, 0]  # type: ignore[union-attr]
    turned = scan.move(np.diag([1.0, -1.0, -1.0, 1.0]))
    assert turned.viewpoints.tolist() == [[1, -1, -1]] * 2  # type: ignore[union-attr]
