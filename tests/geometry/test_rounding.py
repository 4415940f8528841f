"""Solids in single precision stay watertight, near and far."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Solid, open_edges
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.rounding import round_to_single
from tests.geometry.shapes import ball, box, join


@pytest.mark.parametrize("offset", [1e3, 1e5, 1e6])
def test_rounding_far_from_the_origin_never_opens_a_solid(offset):
    """At 1e6 single precision steps by 0.06: a sphere with edges of 0.02 loses most of its triangles."""
    single = round_to_single(ball(1.0, (offset, offset, 0), subdivisions=5))
    assert single is None or not open_edges(single.faces)
    if offset < 1e6:
        assert single is not None
        assert single.volume == pytest.approx(4.19, rel=0.05)


@given(st.floats(0.01, 100), st.floats(-1e5, 1e5))
@settings(max_examples=30, deadline=None)
def test_what_is_given_is_in_single_precision_and_equal_vertices_are_one(radius: float, offset: float) -> None:
    single = round_to_single(ball(radius, (offset, 0, 0), subdivisions=2))
    if single is None:
        assert radius < 64 * np.spacing(np.float32(abs(offset) + radius))
        return
    assert np.array_equal(single.vertices, single.vertices.astype(np.float32))
    assert len(find_duplicates(single.vertices)[0]) == len(single.vertices)


def test_coordinates_that_fit_stay_as_they_are() -> None:
    made = round_to_single(box(10))
    assert made is not None
    assert np.array_equal(made.vertices, box(10).vertices)
    assert np.array_equal(made.faces, box(10).faces)


def test_what_would_open_is_mended_only_where_that_is_wanted() -> None:
    """At 1e5 single precision steps by 0.008: rounding brings the two sides of thin details together."""
    far = ball(0.1, (1e5, 1e5, 0), subdivisions=5)
    assert round_to_single(far, mend=False) is None
    mended = round_to_single(far)
    assert mended is not None
    assert mended.volume == pytest.approx(far.volume, rel=0.3)


def test_cubes_that_share_an_edge_cannot_be_one_mesh_of_equal_vertices() -> None:
    assert round_to_single(Solid(*join(box(2), box(2, (2, 2, 0)))), mend=False) is None


def test_a_speck_without_volume_is_nothing() -> None:
    assert round_to_single(ball(1e-3, (1e6, 0, 0))) is None
