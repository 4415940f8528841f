"""Sections of shafts and of any part: diameter, run-out, roundness, deviation, depth along a line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.sections.family import measure_shaft

from damageest.artefacts import Floats, Part, Section
from damageest.job.sections import SectionChoice
from damageest.sections.measure import Scanned, measure_sections
from tests.sections.blades import scan_mesh

NOISE, SPACING, TOLERANCE = 0.01, 0.35, 0.1


def make(mesh: trimesh.Trimesh) -> Part:
    return Part(mesh.vertices, mesh.faces)


SLEEVE = make(trimesh.creation.annulus(6, 15, 80, sections=256))
BOX = make(trimesh.creation.box((40, 30, 20)))


def scan_shaft(radius: float, centre: tuple[float, float], lobes: float, arc: float = 2 * np.pi) -> Floats:
    """Points on a cylinder with three lobes of half the height ``lobes``, over an angle."""
    rng = np.random.default_rng(3)
    count = int(radius * arc * 80 / SPACING**2)
    angle, z = rng.uniform(0, arc, count), rng.uniform(-40, 40, count)
    size = radius + lobes / 2 * np.cos(3 * angle) + rng.normal(0, NOISE, count)
    return np.stack([centre[0] + size * np.cos(angle), centre[1] + size * np.sin(angle), z], axis=1)


def cut(part: Part, points: Floats, *choices: dict[str, Any]) -> tuple[Section, ...]:
    asked = [SectionChoice.model_validate(choice) for choice in choices]
    return measure_sections(asked, part, Scanned(points, SPACING, NOISE), TOLERANCE)


def test_diameter_run_out_and_roundness_of_a_shaft_with_a_bore() -> None:
    outer, bore = scan_shaft(14.9, (0.06, -0.08), 0.1), scan_shaft(6.04, (0, 0), 0.0)
    for section in cut(SLEEVE, np.concatenate([outer, bore]), {"along": "axis", "count": 3}):
        assert section.kind == "round"
        truth = {"diameter": 29.8, "off centre": 0.1, "roundness": 0.1, "bore 1 diameter": 12.08}
        for name, value in truth.items():
            found = section.value(name)
            assert found.measured == pytest.approx(value, abs=0.01 if "diameter" in name else 0.03), name
        # three lobes and an eccentricity: their sum at most, its greater part at least
        assert 0.2 < (section.value("run-out").measured or 0) < 0.33


@pytest.mark.parametrize("seed", [1, 2, 3, 5, *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 36))])
def test_the_diameter_is_that_of_the_least_squares_circle_of_the_form(seed: int) -> None:
    found = measure_shaft(seed)
    assert found["error"] > 0
    assert abs(found["measured"] - found["true"]) <= 3 * found["error"]


def test_the_circle_that_is_meant_is_said() -> None:
    (section,) = cut(SLEEVE, scan_shaft(15.0, (0, 0), 0.1), {"z": 5})
    assert "least-squares circle (GG" in section.value("diameter").note


def test_a_groove_in_a_shaft_does_not_change_its_diameter() -> None:
    points = scan_shaft(15.0, (0, 0), 0.0)
    angle = np.arctan2(points[:, 1], points[:, 0])
    points[:, :2] *= 1 - (0.5 / 15 * (np.abs(angle) < 0.15))[:, None]
    (section,) = cut(SLEEVE, points, {"z": 5})
    assert section.value("diameter").measured == pytest.approx(30, abs=0.01)
    assert section.value("deepest").measured == pytest.approx(-0.5, abs=0.03)


def test_a_short_arc_gives_no_diameter_and_half_a_circle_says_so() -> None:
    (short,) = cut(SLEEVE, scan_shaft(15, (0, 0), 0, arc=1.2), {"z": 0})
    assert short.value("diameter").measured is None
    assert "degrees of it" in short.value("diameter").note
    (half,) = cut(SLEEVE, scan_shaft(14.95, (0, 0), 0, arc=3.3), {"z": 0})
    assert half.value("diameter").measured == pytest.approx(29.9, abs=4 * half.value("diameter").error + 0.005)
    assert "degrees that the scan shows" in half.value("diameter").note


def test_a_part_that_is_neither_has_its_deviation_alone() -> None:
    points = scan_mesh(BOX, SPACING, NOISE)
    asked = ({"z": 1}, {"z": 1, "kind": "round"}, {"plane": {"point": [0, 0, 0], "normal": [1, 1, 1]}})
    for section in cut(BOX, points, *asked):
        assert section.kind == "contour"
        assert [value.name for value in section.values] == ["deepest", "highest", "line profile"]
        assert section.value("line profile").measured == pytest.approx(0, abs=8 * NOISE)
    assert "no circle" in cut(BOX, points, asked[1])[0].notes[0]


def test_depth_of_wear_along_a_line() -> None:
    points = scan_mesh(BOX, SPACING, NOISE)
    worn = (points[:, 2] > 9.9) & (np.abs(points[:, 0]) < 8)
    points[worn, 2] -= 0.4 * (1 - (points[worn, 0] / 8) ** 2)
    line, part_of = cut(
        BOX, points, {"line": {"from": [-18, 0, 10], "to": [18, 0, 10]}},
        {"line": {"from": [0, 0, 30], "to": [40, 0, 30]}},
    )  # fmt: skip
    assert line.value("deepest").measured == pytest.approx(-0.4, abs=0.03)
    depth = line.contours[0].distance
    at = line.contours[0].lengths - 18
    truth = -0.4 * np.clip(1 - (at / 8) ** 2, 0, None)
    known = np.isfinite(depth)
    assert known.mean() > 0.9
    assert np.abs(depth - truth)[known].max() < 0.08
    assert "off the skin" in part_of.notes[0]
