"""The errors of the sensor, as a run measures them, and what it makes of places that they explain."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS

import damageest
from damageest.artefacts import Part, Scan
from damageest.result import Result
from damageest.stages.report._values import list_sensor
from damageest.stages.report._words import ENGLISH_WORDS
from damageest.stages.report.scene._least_depth import map_least_depth
from damageest.stages.scan.simulate import Simulate

UNIT = PARTS["ribbed_plate"]().diagonal / 250
"""A millimetre of a part that is 250 mm across."""


def scan_by_camera(part: Part, seed: int = 0, **options: object) -> Scan:
    """As a depth camera: errors that regions share, steps of the depth."""
    settings = {
        "points": 8000, "scanners": [[300 * UNIT, 180 * UNIT, 480 * UNIT]], "noise": 0.5 * UNIT,
        "depth_step": UNIT, "waviness": 0.6 * UNIT, "wavelength": 40 * UNIT, "max_incidence": 70, "seed": seed,
        "positions_known": False, **options,
    }  # fmt: skip
    return Simulate.model_validate(settings).run("mm", part)


def run(part: Part, scan: Scan, tolerance: object = "auto", **job: object) -> Result:
    return damageest.run({"version": 1, "tolerance": tolerance, "align": "icp", **job}, part=part, scan=scan)


@pytest.fixture(scope="module")
def intact() -> Result:
    """An undamaged plate in a scan by a depth camera."""
    part = PARTS["ribbed_plate"]()
    return run(part, scan_by_camera(part, seed=2))


@pytest.mark.slow
def test_errors_of_a_clean_scan_are_its_noise() -> None:
    part = PARTS["ribbed_plate"]()
    scan = Simulate(points=8000, noise=0.05, scanners=6).run("mm", part)
    sensor = run(part, scan, 0.2).sensor
    assert sensor is not None
    assert sensor.noise == pytest.approx(0.05, rel=0.1)
    assert sensor.correlated < 0.02
    assert sensor.least_depth == pytest.approx(0.2, rel=0.15)
    assert all(one.noise == pytest.approx(0.05, rel=0.6) for one in sensor.levels)
    assert len(sensor.semivariogram) > 6
    assert all(one.semivariance == pytest.approx(0.05**2, rel=0.25) for one in sensor.semivariogram)
    assert {one.of for one in sensor.levels} == {"incidence", "distance"}


@pytest.mark.slow
def test_errors_that_regions_share_are_told_from_noise(intact: Result) -> None:
    sensor = intact.sensor
    assert sensor is not None
    assert sensor.noise == pytest.approx(0.57 * UNIT, rel=0.15)
    assert 0.3 * UNIT < sensor.correlated < 0.9 * UNIT
    assert sensor.depth_step == pytest.approx(UNIT, rel=0.05) or not sensor.depth_step
    near = next(one.semivariance for one in sensor.semivariogram if one.distance > 3 * UNIT)  # beyond one step's area
    assert near == pytest.approx((0.57 * UNIT) ** 2, rel=0.2)
    far = max(one.semivariance for one in sensor.semivariogram)
    assert far == pytest.approx((0.57**2 + 0.6**2) * UNIT**2, rel=0.3), "noise, and what regions share"
    assert sensor.least_depth > 2.3 * UNIT


def require_no_site(result: Result) -> None:
    """They had sites of up to 17,547 mm³, likely."""
    assert [site.verdict.level for site in result.sites if site.accepted] == []
    assert len(result.sites) <= 1


def test_an_undamaged_part_has_no_site_in_a_scan_by_a_depth_camera(intact: Result) -> None:
    require_no_site(intact)


@pytest.mark.slow
def test_an_undamaged_lever_has_none_either() -> None:
    part = PARTS["lever"]()
    require_no_site(run(part, scan_by_camera(part, seed=2)))


@pytest.mark.slow
def test_places_below_a_tolerance_that_the_sensor_does_not_allow_are_no_sites() -> None:
    """They stay in the total's high end, and are named in one line."""
    part = PARTS["lever"]()
    scan = scan_by_camera(part, seed=0)
    result = run(part, scan, 1.5 * UNIT)
    folded = [note for note in result.warnings if note.code == "below_noise"]
    assert result.sensor is not None
    assert result.sensor.least_depth > 2 * UNIT
    doubtful = [site for site in result.sites if site.verdict.level == "doubtful"]
    assert all(site.max_depth >= result.sensor.least_depth for site in doubtful)
    assert len(folded) == 1
    assert folded[0].amount
    assert result.volume_95 is None or result.volume_95[1] >= folded[0].amount
    shown = run(part, scan, 1.5 * UNIT, accept="all")
    assert len(shown.sites) > len(result.sites)


@pytest.mark.slow
def test_a_loss_deeper_than_the_errors_is_found() -> None:
    part = PARTS["block"]()
    top = part.bounds[1]
    tool = {"tool": "sphere", "centre": [float(top[0]), float(top[1]), float(top[2])], "radius": 14.0}
    scan = scan_by_camera(part, points=5000, damage=[tool], scanners=[[150, 120, 180], [150, -60, 160]])
    result = run(part, scan)
    assert result.sites
    assert result.truth is not None
    assert result.sites[0].volume_95 is not None
    low, high = result.sites[0].volume_95
    assert low <= result.truth[0] <= high
    assert np.isfinite(low)


@pytest.mark.slow
def test_where_the_scan_is_noisier_a_loss_has_to_be_deeper() -> None:
    """By place: half of a plate is scanned with four times the noise."""
    part = PARTS["ribbed_plate"]()
    scan = Simulate(points=8000, noise=0.02, scanners=6).run("mm", part)
    noisy = scan.points[:, 0] > 0
    extra = np.random.default_rng(3).normal(scale=0.08, size=scan.points.shape) * noisy[:, None]
    result = run(part, Scan(scan.points + extra), 0.4)
    assert result.sensor is not None
    chosen = np.flatnonzero((result.deviation.label == 0) & (np.abs(result.aligned.points[:, 0]) > 5))
    depth = map_least_depth(result.aligned, result.deviation, result.sensor, 0.05, chosen)
    right = result.aligned.points[chosen, 0] > 0
    assert np.median(depth[right]) > 2.5 * np.median(depth[~right])
    assert depth.min() >= 0.05
    (page,) = list_sensor(result, ENGLISH_WORDS)[:1]
    assert page[1].startswith("0.400 mm deep, ")
