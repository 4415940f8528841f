"""Rows of vectors."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from damageest.geometry.vectors import cross_corners, measure_longest_edges, normalise
from tests.damaged_box import box

ROOT = Path(__file__).parents[2]
BY_HAND = re.compile(
    r"(?<!\* )\b([A-Za-z_][\w.]*(?:\[[\w:.]+\])?) /=? (?:np\.maximum\()?np\.linalg\.norm\(\1, axis=(?:1|2|-1)\b"
)
"""A name divided by the lengths of its own rows."""
SIZES = st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda value: value == 0 or abs(value) > 1e-6)


@pytest.mark.slow
@given(arrays(np.float64, (5, 2, 3), elements=SIZES))
def test_rows_have_length_1_and_their_direction(vectors: np.ndarray) -> None:
    found, length = normalise(vectors), np.linalg.norm(vectors, axis=-1)
    assert found.shape == vectors.shape
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), length > 0, atol=1e-12)
    np.testing.assert_allclose(found * length[..., None], vectors, rtol=1e-12, atol=0)


def test_what_is_shorter_than_the_least_length_is_no_direction() -> None:
    np.testing.assert_allclose(normalise(np.array([[1e-15, 0, 0], [1e-3, 0, 0]]), 1e-12)[:, 0], [1e-3, 1])


@pytest.mark.parametrize("folder", ["damageest", "plugins"])
def test_nobody_normalises_rows_by_hand(folder: str) -> None:
    own = {"damageest/geometry/vectors.py", "damageest/artefacts/meshes.py"}  # the latter is below geometry
    found = {
        path.relative_to(ROOT).as_posix(): [hit[0] for hit in BY_HAND.finditer(path.read_text())]
        for path in sorted((ROOT / folder).rglob("*.py"))
        if "tests" not in path.parts and "conformance" not in path.parts
    }
    assert {name: hits for name, hits in found.items() if hits and name not in own} == {}


@pytest.mark.slow
@given(arrays(np.float64, (4, 3, 3), elements=SIZES))
def test_the_longest_edge_is_the_largest_distance_of_two_corners(triangles: np.ndarray) -> None:
    wanted = [max(np.linalg.norm(a - b) for a in one for b in one) for one in triangles]
    np.testing.assert_allclose(measure_longest_edges(triangles), wanted)


def test_the_cross_of_corners_is_that_of_the_mesh() -> None:
    part = box()
    assert np.array_equal(cross_corners(part.triangles), part.cross)
    assert part.face_areas.sum() == pytest.approx(part.area)
    assert np.allclose(part.face_areas[:, None] * part.face_normals * 2, part.cross)
