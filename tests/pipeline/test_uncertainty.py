"""Intervals through the whole route: the truth lies in them, doubtful sites have one, wear says how it fades out."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import damageest
from damageest.artefacts import Deviation, Floats, Pose, Reason, Scan
from damageest.cli import app
from damageest.findings import Sensor, describe_interval
from damageest.pipeline.judging.uncertainty import sum_uncertainty
from damageest.pipeline.state import JobState
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from tests import damaged_box

BALL = {"tool": "sphere", "centre": [0, 0, 10], "radius": 6}
OTHER = {"tool": "sphere", "centre": [20, 0, 0], "radius": 5}
TRUE_VOLUMES = (np.pi * 6**3 * 2 / 3, np.pi * 5**3 * 2 / 3)


@cache
def run(points: int, noise: float, *tools: int) -> Result:
    part = damaged_box.box()
    scanner = Simulate.model_validate({"damage": [(BALL, OTHER)[k] for k in tools], "points": points, "noise": noise})
    scan = Scan(scanner.run("mm", part).points)
    return damageest.run({"version": 1, "tolerance": 4 * noise}, part=part, scan=scan, settings=["align=none"])


@pytest.mark.slow
def test_truth_lies_in_the_intervals_of_both_sites_and_of_the_total() -> None:
    result = run(20_000, 0.04, 0, 1)
    assert len(result.sites) == 2
    for site, volume, depth in zip(result.sites, TRUE_VOLUMES, (6.0, 5.0), strict=True):
        assert site.volume_95 is not None
        assert site.depth_95 is not None
        assert site.volume_95[0] <= volume <= site.volume_95[1]
        assert site.depth_95[0] <= depth <= site.depth_95[1]
        assert site.volume_95[0] <= site.damage.volume <= site.volume_95[1]
        assert site.volume_95[1] - site.volume_95[0] < 0.06 * volume
        assert site.fading is None
    assert result.volume_95 is not None
    assert result.volume_95[0] <= sum(TRUE_VOLUMES) <= result.volume_95[1]


@pytest.mark.slow
def test_total_is_narrower_than_the_sites_together_and_wider_than_each() -> None:
    result = run(20_000, 0.04, 0, 1)
    widths = [site.volume_95[1] - site.volume_95[0] for site in result.sites if site.volume_95]
    assert result.volume_95 is not None
    total = result.volume_95[1] - result.volume_95[0]
    assert max(widths) < total < sum(widths)


@pytest.mark.slow
def test_an_undamaged_part_has_lost_nothing() -> None:
    low, high = run(3000, 0.06).volume_95 or (np.inf, np.inf)
    skin = np.linalg.norm(damaged_box.box().cross, axis=1).sum() / 2
    assert low == 0
    assert 0 < high < 0.15 * 4 * 0.06 * skin, "far less than the tolerance all over"


def worn_plate(amplitude: float, noise: float) -> tuple[Floats, float]:
    """A scan of the box with a worn hollow on top that fades out to all sides, and the volume lost."""
    width = 5.0
    points = np.array(Simulate.model_validate({"points": 5000, "noise": 0}).run("mm", damaged_box.box()).points)
    top = points[:, 2] > damaged_box.SIZE[2] / 2 - 1e-9
    points[top, 2] -= amplitude * np.exp(-(points[top, :2] ** 2).sum(axis=1) / (2 * width**2))
    points += np.random.default_rng(0).normal(scale=noise, size=points.shape)
    return points, amplitude * 2 * np.pi * width**2 * 0.99  # the rest is beyond the edge of the box


@pytest.mark.slow
def test_wear_says_how_it_fades_out_and_the_interval_holds_what_it_leaves_out() -> None:
    points, volume = worn_plate(amplitude=0.5, noise=0.04)
    job = {"version": 1, "tolerance": 0.2}
    result = damageest.run(job, part=damaged_box.box(), scan=Scan(points), settings=["align=none", "adapt=none"])
    site = result.sites[0]
    assert site.fading is not None
    assert site.volume_95 is not None
    assert site.damage.volume < volume
    assert site.fading.half > site.fading.at > site.fading.twice > 0
    assert site.fading.beyond == pytest.approx(volume - site.damage.volume, rel=0.5)
    assert site.volume_95[0] <= volume <= site.volume_95[1]
    assert "fading" in [reason.code for reason in site.verdict.reasons]


@pytest.mark.slow
def test_a_doubtful_site_has_an_interval_and_raises_the_total() -> None:
    rng = np.random.default_rng(3)
    place = rng.uniform([3.8, 7.8], [6.2, 10.2], (60, 2))  # stray points below skin that has its own points
    strays = np.column_stack([place, rng.normal(damaged_box.SIZE[2] / 2 - 1, 0.04, 60)])
    scanner = Simulate.model_validate({"points": 8000, "noise": 0.04})
    scan = Scan(np.concatenate([scanner.run("mm", damaged_box.box()).points, strays]))
    result = damageest.run({"version": 1, "tolerance": 0.2}, part=damaged_box.box(), scan=scan, settings=["align=none"])
    (site,) = result.sites
    assert site.verdict.level == "doubtful"
    assert site.volume_95 is not None
    assert site.volume_95[0] < site.damage.volume < site.volume_95[1]
    assert "contradicts" in [reason.effect for reason in site.verdict.reasons]
    assert result.volume_95 == pytest.approx((0.0, site.volume_95[1]))


@pytest.mark.slow
def test_table_and_result_json_have_the_interval(small_done: Path) -> None:
    done = CliRunner().invoke(app, ["run", str(small_done)])
    assert done.exit_code == 0, done.output
    report = json.loads((small_done.parent / "out/job/result.json").read_text())
    low, high = report["volume_95"]
    assert low <= damaged_box.TRUE_VOLUME <= high
    site = report["sites"][0]
    assert site["volume_95"] == pytest.approx([low, high])
    assert site["depth_95"][0] < 6 < site["depth_95"][1]
    assert site["uncertainty"]["noise"] > 0
    told = describe_interval((low, high))
    assert told in done.output
    assert [float(end) for end in told.split(" to ")] == pytest.approx([low, high], abs=0.05 * (high - low))


def test_without_sites_nothing_is_lost_unless_the_pose_is_doubted() -> None:
    part, points = damaged_box.box(), damaged_box.scan(6000)
    scan = Scan(points, noise=0.04, spacing=0.5)
    skin = Deviation(np.zeros(len(points)), np.zeros(len(points), int), np.zeros(len(points), np.uint8))
    other = Pose(np.eye(4), doubts=(Reason("other_poses", "two fit", "contradicts"),))
    sensor = Sensor(0.04, 0.0, 0.0, 0.0, 0.0, 0.16, 2.0)
    state = JobState({"found": (), "failures": (), "folded": 0.0, "views": None, "adapted": None, "sensor": sensor})
    for name, value in (("part", part), ("aligned", scan), ("deviation", skin), ("tolerance", 0.16)):
        state = state.with_named(name, value, name)
    volume, budget = sum_uncertainty(state.with_value(JobState.pose, Pose(np.eye(4)), "held"))
    low, high = volume or (1, 0)
    assert low == 0 < high < 50
    assert budget is None
    assert sum_uncertainty(state.with_value(JobState.pose, other, "doubted")) == (None, None)
