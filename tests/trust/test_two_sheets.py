"""Two surfaces over the same skin are told from the rim of a loss, on a box with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import damageest
from damageest.artefacts import DAMAGE, INTACT, Deviation, Floats, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.stages.scan.simulate import Simulate
from damageest.trust.views.two_sheets import AGAINST, OF_SCAN, measure_sheets, measure_two_sheets
from tests.damaged_box import SIZE, box

TOLERANCE, NOISE = 0.2, 0.05
TOP = SIZE[2] / 2


def scan_box(seed: int, *tools: dict[str, object], points: int = 20_000, noise: float = NOISE) -> Floats:
    scanner = Simulate.model_validate({"damage": list(tools), "points": points, "noise": noise, "seed": seed})
    return np.array(scanner.run("mm", box()).points)


def lower_top(points: Floats, depth: float, where: Floats) -> Floats:
    """The points with the top lower by ``depth`` where the scan shows it too deep."""
    out = points.copy()
    out[where & (points[:, 2] > TOP - 4 * NOISE), 2] -= depth
    return out


def compare(points: Floats) -> ScanField:
    distance, face = signed_distance(points, box())
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    scan = Scan(points, noise=NOISE, spacing=0.6)
    return ScanField(box(), scan, Deviation(distance, face, label), TOLERANCE)


def measure(points: Floats) -> float:
    field = compare(points)
    return measure_two_sheets(field, np.flatnonzero(field.label == DAMAGE))


def measure_scan(points: Floats) -> float:
    return measure_sheets(compare(points)).share


@pytest.mark.parametrize("depth", [1.5, 2.0, 4.0])
def test_a_second_view_below_the_first_is_found(depth: float) -> None:
    first, second = scan_box(1), scan_box(2)
    low = lower_top(second, depth * TOLERANCE, second[:, 0] > -8)
    assert measure(np.concatenate([first, low])) > 1.3 * AGAINST


def test_views_that_do_not_fit_are_found_where_none_of_them_shows_a_site() -> None:
    """Where both show the skin, the second lies less than a tolerance below."""
    first, second = scan_box(1), scan_box(2)
    low = lower_top(second, 0.9 * TOLERANCE, second[:, 0] > 0)
    assert measure_scan(np.concatenate([first, low])) > 2 * OF_SCAN


@pytest.mark.parametrize(
    "tool",
    [
        {"tool": "sphere", "centre": [0, 0, TOP + 2], "radius": 6},
        {"tool": "sphere", "centre": [0, 0, TOP + 7.5], "radius": 8},
        {"tool": "box", "centre": [0, 0, TOP], "size": [12, 1.2, 1.0]},
        {"tool": "box", "centre": [0, 0, TOP], "size": [14, 10, 0.9]},
        {"tool": "box", "centre": [0, 0, TOP], "size": [3, 3, 5]},
        {"tool": "cylinder", "point": [0, 0, TOP - 3], "axis": [0, 0, 1], "radius": 2.5, "length": 8},
    ],
)
def test_the_rim_of_a_loss_is_no_second_surface(tool: dict[str, object]) -> None:
    assert measure(scan_box(1, tool, points=40_000)) < AGAINST / 2


@pytest.mark.parametrize("depth", [0.65, 0.8, 1.0])
def test_wear_of_about_a_tolerance_is_one_surface_with_noise(depth: float) -> None:
    points = scan_box(1, points=40_000)
    assert measure(points) == 0
    assert measure_scan(points) < OF_SCAN / 2
    assert measure(lower_top(points, depth * TOLERANCE, points[:, 0] > -8)) < AGAINST / 2


@pytest.mark.slow
def test_a_false_site_of_a_misplaced_view_is_doubtful_and_names_the_cause() -> None:
    first, second = scan_box(1, points=6000), scan_box(2, points=6000)
    low = lower_top(second, 1.5 * TOLERANCE, np.linalg.norm(second[:, :2] - [4, 2], axis=1) < 7)
    job = {"version": 1, "tolerance": TOLERANCE, "align": "none"}
    result = damageest.run(job, part=box(), scan=Scan(np.concatenate([first, low])))
    assert result.sites
    assert not any(site.accepted for site in result.sites)
    assert "two_sheets" in {reason.code for site in result.sites for reason in site.verdict.reasons}


def test_a_waved_face_between_sparse_points_is_one_surface() -> None:
    """As on a fillet whose radius is off: a smooth surface explains the depths, and no second view."""
    points = scan_box(1, points=4000, noise=0.005)
    top = points[:, 2] > TOP - 4 * NOISE
    points[top, 2] = TOP - 0.48 * TOLERANCE * (1 - np.cos(2 * np.pi * points[top, 0] / 4))
    field = compare(points)
    thinned = replace(field, aligned=replace(field.aligned, noise=0.005, spacing=1.14))
    assert measure_sheets(thinned).share < 0.75 * OF_SCAN
