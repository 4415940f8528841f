"""Sections of a blade of known chord, thickness, twist and bow; what is said where they cannot be measured."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Part, Section, SectionValue
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.job.sections import SectionChoice
from damageest.sections.measure import Scanned, measure_sections
from tests.sections.blades import HEIGHT, Blade, scan_mesh

NOISE, SPACING, TOLERANCE = 0.015, 0.4, 0.15
DESIGN = Blade()
MADE = Blade(twist=(10.4, 31.0), bow=0.3)
"""As designed but for twist and bow."""
WORN = Blade(chord=39.4, thickness=4.6, twist=(10.4, 31.0), bow=0.3)
"""As `MADE`, shorter by 0.6 and thinner by 0.2 mm."""


@cache
def design() -> Part:
    return DESIGN.part(rings=31)


@cache
def scan(blade: Blade) -> Floats:
    return scan_mesh(blade.part(), SPACING, NOISE)


@pytest.fixture(scope="module")
def made() -> Floats:
    return scan(MADE)


def cut(points: Floats, *choices: dict[str, Any]) -> tuple[Section, ...]:
    asked = [SectionChoice.model_validate(choice) for choice in choices]
    return measure_sections(asked, design(), Scanned(points, SPACING, NOISE), TOLERANCE)


def off(value: SectionValue, truth: float) -> float:
    assert value.difference is not None, value.note
    return abs(value.difference - truth)


def across_leading(points: Floats, z: float) -> Floats:
    """How far points are from the middle of the chord of a height, toward its trailing edge."""
    angle = np.radians(DESIGN.angle(z))
    return np.asarray(points[:, :2] @ [np.cos(angle), np.sin(angle)])


@pytest.mark.slow
def test_twist_and_bow_of_a_blade_of_the_right_form_are_measured(made: Floats) -> None:
    sections = cut(made, {"along": "axis", "count": 3})
    assert [section.kind for section in sections] == ["blade"] * 3
    for section in sections:
        z = section.origin[2]
        assert off(section.value("twist"), MADE.angle(z) - DESIGN.angle(z)) < 0.02
        assert off(section.value("bow"), MADE.bowed(z)) < 0.005
        assert off(section.value("chord"), 0) < max(3 * section.value("chord").error, 0.05)
        assert off(section.value("thickness"), 0) < 0.03
    ends = [MADE.bowed(sections[k].origin[2]) for k in (0, -1)]
    middle = MADE.bowed(sections[1].origin[2]) - (ends[0] + ends[1]) / 2
    assert off(sections[1].value("bow from straight"), middle) < 0.01


@pytest.mark.slow
def test_a_shorter_and_thinner_section_is_not_taken_for_a_moved_one() -> None:
    flatter = 0.05 * 0.6 * 2 / 3  # by how much less the mean of the camber line is off the chord
    for section in cut(scan(WORN), {"along": "z", "count": 2}):
        z = section.origin[2]
        assert off(section.value("chord"), -0.6) < max(3 * section.value("chord").error, 0.1)
        assert off(section.value("thickness"), -0.2) < 0.03
        assert off(section.value("twist"), WORN.angle(z) - DESIGN.angle(z)) < 0.1
        assert off(section.value("bow"), WORN.bowed(z)) < flatter + 0.02


def test_where_an_edge_is_not_scanned_chord_is_not_given_and_twist_is_right(made: Floats) -> None:
    points = made
    (section,) = cut(points[across_leading(points, 45) > -17], {"z": 45})
    for name in ("chord", "leading edge"):
        assert section.value(name).measured is None
        assert "does not show the leading edge" in section.value(name).note
    assert section.value("trailing edge").measured is not None
    assert off(section.value("twist"), MADE.angle(45) - DESIGN.angle(45)) < 0.05
    assert off(section.value("bow"), MADE.bowed(45)) < 0.02


def test_an_edge_that_is_broken_off_and_scanned_makes_the_chord_shorter() -> None:
    angle = np.radians(DESIGN.angle(45))
    way = np.array([np.cos(angle), np.sin(angle), 0])
    vertices, faces = to_arrays(to_manifold(MADE.part()).trim_by_plane(way, -17.0))
    points = scan_mesh(Part(vertices, faces), SPACING, NOISE)
    (section,) = cut(points, {"z": 45})
    chord = section.value("chord")
    assert off(chord, -3.0) < 0.2
    assert section.value("leading edge").measured == pytest.approx(-3, abs=0.2)
    assert off(section.value("twist"), MADE.angle(45) - DESIGN.angle(45)) < 0.1


def test_a_place_that_was_not_scanned_and_a_plane_beside_the_part_are_said(made: Floats) -> None:
    points = made
    unseen, beside = cut(points[points[:, 2] > 60], {"z": 30}, {"z": HEIGHT + 7})
    assert unseen.seen == 0
    assert "the scan does not show the part here" in unseen.notes
    assert all(value.measured is None and value.note for value in unseen.values)
    assert beside.kind == "none"
    assert not beside.values
    assert "passes beside the part, 7 mm from it" in beside.notes[0]


@pytest.mark.slow
def test_one_side_alone_leaves_the_bow_as_unsure_as_the_thickness(made: Floats) -> None:
    points = made
    near = points[np.abs(points[:, 2] - 45) < 1]
    normals = design().face_normals[closest_on_mesh(near, design()).face]
    angle = np.radians(DESIGN.angle(45))
    (both,) = cut(near, {"z": 45})
    (one,) = cut(near[normals @ [-np.sin(angle), np.cos(angle), 0] > 0.3], {"z": 45})
    assert one.value("bow").measured is None or one.value("bow").error > 10 * both.value("bow").error
    assert one.value("chord").measured is None
    assert one.value("thickness").measured is None
