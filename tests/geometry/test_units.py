"""Units and the telling of a wrong one."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from damageest.errors import InputError
from damageest.geometry.units import (
    MILLIMETRES,
    UnitOption,
    canonical_unit,
    describe_size,
    diagnose_scale,
    diagnose_size,
    question_size,
    unit_factor,
)

units = st.sampled_from(sorted(MILLIMETRES))


@given(a=units, b=units, c=units)
def test_factors_compose(a, b, c):
    assert unit_factor(a, b) * unit_factor(b, c) == pytest.approx(unit_factor(a, c))
    assert unit_factor(a, a) == 1


def test_names_and_aliases():
    assert unit_factor("in", "mm") == 25.4
    assert unit_factor("inches", "Millimeter") == 25.4
    assert canonical_unit("µm") == canonical_unit("micron") == "um"


def test_an_unknown_unit_names_the_near_miss_and_the_valid_ones():
    with pytest.raises(InputError, match=r"'inchs'.*did you mean 'inch.*valid units: um, mm, cm, m, in, ft"):
        canonical_unit("inchs")


def test_as_an_option_it_is_checked_and_shortened():
    class Options(BaseModel):
        unit: UnitOption

    assert Options(unit="inch").unit == "in"
    with pytest.raises(ValidationError, match="unknown unit 'parsec'"):
        Options(unit="parsec")


PARTS = {
    "block": trimesh.creation.box((80, 50, 30)),
    "shaft": trimesh.creation.cylinder(5, 200),
    "ring": trimesh.creation.torus(30, 5),
}


def scanned(name, seed=0, keep=1.0):
    """Points on the part, turned and moved; with ``keep`` < 1 only those of the lower end along a random direction."""
    rng = np.random.default_rng(seed)
    points = trimesh.sample.sample_surface(PARTS[name], 5000, seed=seed)[0]
    along = points @ rng.normal(size=3)
    points = points[along <= np.quantile(along, keep)]
    return points @ trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3].T + rng.normal(size=3) * 500


@given(name=st.sampled_from(sorted(PARTS)), seed=st.integers(0, 1000), keep=st.floats(0.5, 1.0))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_partial_scans_in_the_right_unit_pass(name, seed, keep):
    assert diagnose_scale(scanned(name, seed, keep), PARTS[name].vertices) is None


def test_a_fixture_and_outliers_pass():
    rng = np.random.default_rng(0)
    plate = rng.uniform(-100, 100, (3000, 3)) * [1, 1, 0.01] + scanned("block").mean(0)
    assert diagnose_scale(np.concatenate([scanned("block"), plate]), PARTS["block"].vertices) is None
    stray = rng.normal(size=(20, 3)) * 1e5
    assert diagnose_scale(np.concatenate([scanned("block"), stray]), PARTS["block"].vertices) is None


@pytest.mark.parametrize(
    ("wrong", "unit", "remedies"),
    [
        (25.4, "mm", ["part.unit: in"]),
        (1 / 25.4, "mm", ["scan.unit: in"]),
        (25.4, "in", ["scan.unit: mm"]),
        (1e-3, "mm", ["scan.unit: m"]),
        (1e3, "mm", ["part.unit: m"]),
        (1e3, "m", ["scan.unit: mm"]),
        (0.1, "mm", ["scan.unit: cm"]),
    ],
)
@pytest.mark.parametrize("keep", [0.7, 1.0])
@pytest.mark.parametrize("name", sorted(PARTS))
def test_a_wrong_unit_is_named_with_what_to_set(wrong, unit, remedies, keep, name):
    said = diagnose_scale(scanned(name, 3, keep) * wrong, PARTS[name].vertices, unit)
    assert said is not None
    for remedy in remedies:
        assert f"set {remedy}" in said or f"or {remedy}" in said


def test_sizes_that_no_unit_explains_are_said_not_to_fit():
    said = diagnose_scale(scanned("block") * 3.6, PARTS["block"].vertices)
    assert said is not None
    assert "no wrong unit explains" in said
    assert "crop the scan" in said


@pytest.mark.parametrize(("times", "crop"), [(4.8, True), (10, False), (25.4, False), (1000, False)])
def test_a_scan_with_its_surroundings_is_not_taken_for_a_wrong_unit(times, crop):
    said = diagnose_scale(scanned("block") * times, PARTS["block"].vertices)
    assert said is not None
    assert ("or the scan shows more than the part: crop it" in said) == crop


def test_a_piece_of_the_part_needs_its_pose():
    points = scanned("block") / 3.9
    said = diagnose_scale(points, PARTS["block"].vertices)
    assert said is not None
    assert "no wrong unit explains" in said
    assert said.endswith("only a piece of the part was scanned, give the pose: align: none or align: icp")


@pytest.mark.parametrize(("scan", "part"), [("cm", "m"), ("m", "cm"), ("cm", "mm"), ("mm", "cm"), ("m", "mm")])
@pytest.mark.parametrize("job", ["mm", "cm", "m"])
def test_metric_units_are_told_apart_in_a_job_of_any_unit(scan, part, job):
    """The numbers of scan and part are each in a unit of their own, and both are read as the job's."""
    points = scanned("block") * unit_factor("mm", scan)
    vertices = PARTS["block"].vertices * unit_factor("mm", part)
    said = diagnose_scale(points, vertices, job)
    assert said is not None
    if job != scan:
        assert f"scan.unit: {scan}" in said or f"part.unit: {part}" in said or "or part.unit" in said
    if job not in (scan, part) and {scan, part} == {"cm", "m"}:
        assert f"set scan.unit: {scan} and part.unit: {part}" in said
        assert "100" in said


def test_a_part_of_doubtful_size():
    block = PARTS["block"].vertices
    assert diagnose_size(block, "mm") is None
    assert diagnose_size(block / 1000, "m") is None
    said = diagnose_size(block / 1000, "mm")
    assert said is not None
    assert said.startswith("the part is 0.08 mm across; is `units: mm` right?")
    assert diagnose_size(block, "um") is None
    assert "8000 m across" in str(diagnose_size(100 * block, "m"))


def test_a_part_that_is_tiny_for_its_tolerance_is_questioned():
    block = PARTS["block"].vertices
    across = np.ptp(block, axis=0)
    assert describe_size(block, "mm") == " x ".join(f"{length:.3g}" for length in across) + " mm"
    assert question_size(0.15, block, "mm") is None
    said = question_size(0.15, block / 25.4, "mm")  # inches, in a job in millimetres
    assert said is not None
    assert "is `units: mm` right" in said
    assert describe_size(block / 25.4, "mm") in said
