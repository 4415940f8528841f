"""Bubbles are empty spaces that a body encloses: no cavity of the part's design, and none that metal fills."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Part, Solid
from damageest.geometry.bubbles import fill_bubbles, find_bubbles
from damageest.geometry.solids import to_arrays, to_manifold
from tests.geometry.shapes import ball, box

ORIGIN = np.array([3.0, -2.0, 1.0])
BLOCK, HOLLOW = to_manifold(box(20.0)), to_manifold(ball(3.0))
BODY = Solid(*to_arrays(BLOCK - HOLLOW))
SOLID_PART, HOLLOW_PART = Part(*to_arrays(BLOCK)), Part(*to_arrays(BLOCK - HOLLOW))


def nothing() -> object:
    return to_manifold(box(1.0, at=(90, 0, 0)), ORIGIN)


def test_an_empty_space_is_found_and_filled() -> None:
    (bubble,) = find_bubbles(BODY, nothing, SOLID_PART, ORIGIN)
    assert bubble.volume() == pytest.approx(HOLLOW.volume())
    filled = fill_bubbles(to_manifold(BODY, ORIGIN), nothing(), SOLID_PART, ORIGIN)
    assert filled.volume() == pytest.approx(8000)


def test_a_body_without_one_asks_for_no_metal() -> None:
    assert find_bubbles(box(20.0), lambda: pytest.fail("it was asked for"), SOLID_PART, ORIGIN) == []


def test_what_is_designed_or_filled_with_metal_is_none() -> None:
    assert find_bubbles(BODY, nothing, HOLLOW_PART, ORIGIN) == []
    assert find_bubbles(BODY, lambda: to_manifold(ball(3.5), ORIGIN), SOLID_PART, ORIGIN) == []


def test_half_a_space_that_metal_leaves_is_one() -> None:
    lower = to_manifold(box(20.0, at=(0, 0, -10)), ORIGIN)
    (bubble,) = find_bubbles(BODY, lambda: lower, SOLID_PART, ORIGIN)
    assert bubble.volume() == pytest.approx(HOLLOW.volume() / 2, rel=0.02)
