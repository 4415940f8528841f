"""The tolerance follows noise, steps of the depth and form errors; damage does not change it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import Floats, Scan
from damageest.errors import InputError, StageError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.stages.scan.simulate import Simulate
from damageest.trust.scan_quality import (
    check_walls,
    choose_tolerance,
    measure_form_deviation,
    raise_tolerance,
    require_above_noise,
    require_intact,
    require_walls,
)

PART = PARTS["block"]()
SCAN = Scan(np.zeros((1, 3)), noise=0.05, spacing=0.1)


def deviate(sigma: float, worn: float = 0.0, depth: float = 0.5) -> Floats:
    """Signed distances: noise, of which the share ``worn`` is moved inward by ``depth``."""
    rng = np.random.default_rng(1)
    distance = rng.normal(0, sigma, 20_000)
    distance[: round(worn * len(distance))] -= depth
    return distance


def test_auto_is_four_times_the_noise() -> None:
    assert choose_tolerance(None, SCAN, PART) == (pytest.approx(0.2), [])


def test_auto_with_steps() -> None:
    tolerance, warnings = choose_tolerance(None, SCAN, PART, step=1.0)
    assert tolerance == 1.5
    assert warnings[0].code == "depth_steps"
    tolerance, warnings = choose_tolerance(0.3, SCAN, PART, step=1.0)
    assert tolerance == 0.3
    assert "tolerance_small" in [note.code for note in warnings]


@pytest.mark.parametrize("worn", [0.0, 0.3, 0.6])
def test_damage_does_not_change_the_deviation(worn: float) -> None:
    assert measure_form_deviation(deviate(0.05, worn), 3.0) == pytest.approx(0.05, rel=0.1)
    assert raise_tolerance(0.2, deviate(0.05, worn), PART, 0.05) == (0.2, [])


def test_nothing_at_the_surface() -> None:
    assert measure_form_deviation(np.random.default_rng(0).uniform(-3, 3, 20_000), 3.0) == 0
    assert measure_form_deviation(np.empty(0), 3.0) == 0


def test_form_errors_raise_the_tolerance() -> None:
    tolerance, warnings = raise_tolerance(0.2, deviate(0.3, 0.2, 5.0), PART, 0.05)
    assert tolerance == pytest.approx(1.2, rel=0.1)
    assert warnings[0].code == "tolerance_raised"


def test_few_intact_points_stop_the_run() -> None:
    require_intact(deviate(0.05, 0.6), 0.2, PART)
    require_intact(np.empty(0), 0.2, PART)
    with pytest.raises(StageError, match="only 16% of the scan points near the part are within") as caught:
        require_intact(deviate(0.05), 0.01, PART)
    assert "75 % of these points lie within 0.057 mm" in caught.value.remedy


@pytest.mark.slow
def test_a_tolerance_far_below_the_noise() -> None:
    part = PARTS["lever"]()
    scan = Simulate(points=30_000, noise=0.2, seed=3).run("mm", part)
    noise, spacing = measure_noise_and_spacing(scan.points)
    scan = replace(scan, noise=noise, spacing=spacing)
    require_above_noise(0.2, scan, part)
    with pytest.raises(InputError, match=r"noise of the scan, 0\.2 mm; .* at least 0\.8\d? mm.* another unit"):
        require_above_noise(0.05, scan, part)


@pytest.mark.variants(1)
@pytest.mark.parametrize(("name", "points"), [("tube", 300), ("blade", 300), ("grille", 1500), ("ribbed_plate", 1000)])
def test_points_too_far_apart_to_show_the_noise(name: str, points: int) -> None:
    part = PARTS[name]()
    scan = Simulate(points=points, noise=0.01, pose="random", seed=3).run("mm", part)
    noise, spacing = measure_noise_and_spacing(scan.points)
    assert noise > 0.1, "it comes out far too large"
    for tolerance in (0.001, 0.05, 0.3):
        require_above_noise(tolerance, replace(scan, noise=noise, spacing=spacing), part)


def test_a_tolerance_beyond_all_walls() -> None:
    low, high = np.sort(np.ptp(PART.vertices, axis=0))[[0, -1]]
    require_walls(0.4 * low, PART)
    require_walls(0.001 * low, PART)
    with pytest.raises(InputError, match="no damage can be found; give far less than"):
        require_walls(0.6 * high, PART)


def test_a_tolerance_beyond_the_walls() -> None:
    assert not check_walls(0.2, PART)
    assert [note.code for note in check_walls(12.0, PART)] == ["thin_walls"]
