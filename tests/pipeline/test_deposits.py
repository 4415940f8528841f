"""Deposits in a run: figures of the report, sites that are refused, deposits that overlap, what is computed again."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import damageest
from damageest.artefacts import Deposit, Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import iou, to_arrays, to_manifold
from damageest.job import Job
from damageest.output.result_json import build_report, result_schema
from damageest.pipeline.engine import Engine
from damageest.pipeline.judging.deposits import make_deposits, refuse_bubbles, separate_deposits
from damageest.pipeline.state import FoundSite, JobState
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.allowance import Allowance
from damageest.stages.allowance.milling import Milling
from damageest.stages.allowance.none import NoAllowance
from tests import damaged_box
from tests.needs import import_or_skip

OUTER, TOLERANCE = 1.0, 0.4
JOB = (
    damaged_box.JOB.replace("tolerance: 0.2", f"tolerance: {TOLERANCE}")
    + f"allowance: {{use: milling, outer: {OUTER}}}\n"
)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory, registry: Registry) -> tuple[Path, Result]:
    """The folder of a job, which ran once with stock on the skin."""
    path = damaged_box.write(tmp_path_factory.mktemp("milled"), JOB, 6000)
    return path.parent, damageest.run(path, output=True, registry=registry)


@pytest.fixture(scope="module")
def folder(ran: tuple[Path, Result]) -> Path:
    return ran[0]


@pytest.fixture
def copied(folder: Path, tmp_path: Path) -> Path:
    """The job in a folder that a test may change, with its stages."""
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    return tmp_path / "job.yaml"


def test_the_report_has_the_figures(folder: Path) -> None:
    jsonschema = import_or_skip("jsonschema")
    content = json.loads((folder / "out/job/result.json").read_text())
    jsonschema.Draft202012Validator(result_schema()).validate(content)
    (site,) = content["sites"]
    deposit = site["deposit"]
    assert deposit["volume"] == pytest.approx(site["volume"] + deposit["stock_volume"])
    damage = trimesh.load(folder / "out/job" / site["files"]["damage"])
    lid = damage.area_faces[(damage.triangles[:, :, 2] > damaged_box.SIZE[2] / 2 - 1e-6).all(axis=1)].sum()
    assert lid == pytest.approx(np.pi * 36, rel=0.12), "mm2 of the skin that the half ball takes off the top"
    assert deposit["stock_volume"] == pytest.approx(lid * deposit["thickness"]["mean"], rel=0.06)
    assert OUTER <= deposit["thickness"]["min"] <= deposit["thickness"]["max"] <= OUTER + TOLERANCE / 2
    assert deposit["cut_back_volume"] == 0
    assert deposit["faces"] == []
    assert content["material"] == {f"{n}_volume": deposit[k] for n, k in (
        ("deposit", "volume"), ("stock", "stock_volume"), ("cut_back", "cut_back_volume"))}  # fmt: skip
    assert site["files"]["deposit"] == "deposit/site-1.stl"


@pytest.mark.slow
def test_another_outer_runs_allowance_and_export_alone(copied: Path, registry: Registry) -> None:
    result = damageest.run(copied, output=True, settings=["allowance.outer=1.5"], registry=registry)
    assert [record.stage for record in result.stages if not record.cached] == ["allowance", "export", "report"]
    (site,) = result.sites
    assert isinstance(site.deposit, Deposit)
    assert site.deposit.thickness is not None
    assert site.deposit.thickness[0] >= 1.5


@pytest.mark.slow
def test_the_written_job_says_the_same(folder: Path) -> None:
    settings = ["allowance.keep_out=[{cylinder: {from: [9, 0, 5], to: [9, 0, 15], radius: 1}}]"]
    first = damageest.run(folder / "job.yaml", output=folder / "again", settings=settings)
    second = damageest.run(folder / "again/job.yaml")
    assert first.sites[0].deposit is not None
    assert second.sites[0].deposit is not None
    assert first.sites[0].deposit.vertices.tobytes() == second.sites[0].deposit.vertices.tobytes()


@pytest.mark.slow
def test_a_cut_back_enlarges_the_cavity_and_not_the_damage_that_was_found(
    ran: tuple[Path, Result], copied: Path, registry: Registry
) -> None:
    plain = ran[1]
    cut = damageest.run(copied, output=True, settings=["allowance.inner=0.5"], registry=registry)
    before, after = plain.sites[0], cut.sites[0]
    assert after.damage.volume == pytest.approx(2 / 3 * np.pi * 6.5**3, rel=0.05)
    assert cut.undamaged_volume + cut.damage_volume == pytest.approx(plain.part.volume, rel=1e-6)
    assert after.evidence.ids_residual == before.evidence.ids_residual
    assert after.surface.area > 1.1 * before.surface.area
    assert isinstance(after.deposit, Deposit)
    assert after.deposit.cut_back_volume == pytest.approx(after.damage.volume - before.damage.volume)
    assert build_report(cut)["material"]["cut_back_volume"] == after.deposit.cut_back_volume


@pytest.mark.slow
def test_a_refused_site_keeps_its_damage(copied: Path, registry: Registry) -> None:
    box = "[[-9, -9, 5], [9, 9, 15]]"
    settings = [f"allowance.keep_out=[{{box: {box}}}]"]
    refused = damageest.run(copied, output=True, settings=settings, registry=registry)
    assert refused.status == "incomplete"
    assert "allowance: milling (site 1)" in refused.failures[0]
    assert "of the damage volume" in refused.failures[0]
    (site,) = refused.sites
    assert site.deposit is None
    out = copied.parent / "out/job"
    content = json.loads((out / "result.json").read_text())
    assert content["sites"][0]["deposit"] is None
    assert content["material"]["deposit_volume"] == 0
    assert content["damage_volume"] == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    assert not list(out.glob("deposit/*"))


@pytest.mark.slow
def test_the_comparison_with_the_truth_is_that_of_the_damage(tmp_path: Path) -> None:
    damaged_box.write(tmp_path)
    ball = {"tool": "sphere", "centre": [0, 0, 10], "radius": 6}
    scan = {"use": "simulate", "damage": [ball], "points": 20_000, "noise": 0.04}
    job: dict[str, Any] = {"version": 1, "tolerance": 0.2, "align": "none", "scan": scan}
    plain = damageest.run({**job, "part": tmp_path / "box.stl"})
    job["allowance"] = {"use": "milling", "outer": 1.0, "inner": 0.8}
    cut = damageest.run({**job, "part": tmp_path / "box.stl"})
    assert plain.truth is not None
    assert cut.truth is not None
    assert cut.truth[1] == pytest.approx(plain.truth[1], abs=1e-9)
    assert cut.damage_volume > 1.2 * plain.damage_volume


def ball(x: float, radius: float) -> Solid:
    return Solid(*to_arrays(Manifold.sphere(radius, 32).translate((x, 0, 0))))


def lane(number: int, x: float, radius: float, grown: float, cavity: float = 0.0) -> FoundSite:
    """A site with a ball as its damage, a larger one as its deposit, and one as its cavity."""
    damage, deposit = ball(x, radius), ball(x, radius + grown)
    hole = ball(x, radius + cavity) if cavity else None
    stock = deposit.volume - (hole or damage).volume
    cut_back = hole.volume - damage.volume if hole else 0.0
    given = Deposit(deposit.vertices, deposit.faces, hole, stock, cut_back)
    keys = {"damage": f"d{number}", "deposit": f"e{number}"}
    return FoundSite({"damage": damage, "deposit": given}, keys, number=number)


def separate(lanes: list[FoundSite]) -> list[Any]:
    """The deposits of the sites, separated."""
    return [site.deposit for site in separate_deposits(tuple(lanes), 0.1)]


def engine(stage: Allowance | None = None) -> Engine:
    """An engine of a job with this allowance alone."""
    registry = Registry.discover()
    stage = stage or NoAllowance()
    item = replace(registry.get("allowance", stage.use), cls=type(stage))
    job = Job("", "mm", 0.1, "auto", {Allowance: stage}, {Allowance: item}, Path(), "")
    return Engine(job, registry)


def test_deposits_that_overlap_count_once() -> None:
    lanes = [lane(1, 0, 3, 1.0, 0.4), lane(2, 7.2, 3, 1.0, 0.4)]
    first, second = separate(lanes)
    assert first is lanes[0].deposit
    whole = to_manifold(lanes[0].deposit) + to_manifold(lanes[1].deposit)
    assert first.volume + second.volume == pytest.approx(whole.volume(), rel=1e-6)
    assert (to_manifold(first) ^ to_manifold(second)).volume() < 1e-9
    assert (to_manifold(second.cavity) ^ to_manifold(first)).volume() < 1e-9
    assert (to_manifold(second.cavity) - to_manifold(second)).volume() < 1e-9
    assert second.cut_back_volume == pytest.approx(second.cavity.volume - lanes[1].damage.volume)
    assert second.stock_volume == pytest.approx(second.volume - second.cavity.volume)
    assert "overlaps that of site 1" in second.notes[0]


def test_a_deposit_never_loses_its_own_damage() -> None:
    """Not even to an earlier site's stock that runs through it."""
    lanes = [lane(1, 0, 3, 2.0), lane(2, 6.5, 3, 0.5)]
    _, second = separate(lanes)
    assert (to_manifold(lanes[1].damage) - to_manifold(second)).volume() < 1e-9
    assert second.volume < lanes[1].deposit.volume - 1


def test_deposits_apart_stay_as_they_are() -> None:
    lanes = [lane(1, 0, 3, 0.2), lane(2, 9, 3, 0.2)]
    assert separate(lanes) == [site.deposit for site in lanes]


class Told(NoAllowance):
    """Gives the other sites' damages as its deposit, to see what it was told; refuses site 2."""

    def run(self, damage: Solid, others: Solid | None) -> Solid | None:
        if damage.bounds.mean() > 1.5:
            raise StageError("not this one", "another")
        return others


def test_others_and_refusals() -> None:
    lanes = [lane(1, 0, 2, 0.1), lane(2, 6, 2, 0.1), lane(3, -6, 2, 0.1)]
    state = JobState().with_value(JobState.found, tuple(lanes), "lanes").with_value(JobState.part, damaged_box.box())
    found, failures = make_deposits(engine(Told()), state.with_value(JobState.tolerance, 0.1))
    ahead: Any = found
    assert [site.number for site in ahead] == [1, 2, 3]
    assert ahead[0].deposit.volume == pytest.approx(2 * ball(0, 2).volume, rel=1e-6)
    assert iou(ahead[2].deposit, Solid(*to_arrays(to_manifold(ball(0, 2)) + to_manifold(ball(6, 2))))) > 1 - 1e-6
    assert ahead[1].deposit is None
    assert ahead[1].refused
    assert [error.site for error in failures] == [2]


def test_milling_is_registered_with_its_provider() -> None:
    item = Registry.discover().get("allowance", "milling")
    assert item.cls is Milling
    assert item.provider.name == "damageest"


def test_a_deposit_of_any_implementation_with_a_bubble_is_refused() -> None:
    """A hollow stock on a block; a cavity that metal fills, or that the part was designed with, is none."""
    block, lost = Manifold.cube((20, 20, 10)), Manifold.cube((6, 6, 4)).translate((7, 7, 6))
    ball = Manifold.sphere(1, 24)
    full = Manifold.cube((6, 6, 7)).translate((7, 7, 6))
    part, damage = Part(*to_arrays(block)), Solid(*to_arrays(lost))
    hollow = Solid(*to_arrays(full - ball.translate((10, 10, 11.5))))
    with pytest.raises(StageError, match=r"encloses an empty space of 4.* in volume, near \(10, 10, 11.5\)"):
        refuse_bubbles(hollow, damage, part)
    refuse_bubbles(Solid(*to_arrays(full)), damage, part)
    island = ball.translate((10, 10, 8))
    refuse_bubbles(Solid(*to_arrays(full - island)), Solid(*to_arrays(lost - island)), part)
    refuse_bubbles(Solid(*to_arrays(full - island)), Solid(*to_arrays(lost - island)), Part(*to_arrays(block - island)))
