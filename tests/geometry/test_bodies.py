"""Connected bodies, shells and cavities, on solids put together from known ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.geometry.bodies import split_bodies, split_shells
from damageest.geometry.solids import to_solid
from tests.geometry.shapes import FAR, ball, box, invert, join


def test_bodies_are_those_of_manifold3d() -> None:

    whole = sum((Manifold.sphere(1 + 0.1 * k, 24).translate((3.0 * k, 0, 0)) for k in range(6)), Manifold())
    solid = to_solid(whole)
    assert solid is not None
    expected = sorted(body.volume() for body in whole.decompose())
    assert sorted(body.volume for body in split_bodies(solid)) == pytest.approx(expected)


@given(st.lists(st.floats(0.1, 5), min_size=1, max_size=8), st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_shuffled_faces_come_apart_into_the_bodies_they_were(sizes: list[float], seed: int) -> None:
    vertices, faces = join(*(box(size, (11.0 * k, 0, 0)) for k, size in enumerate(sizes)))
    whole = Solid(vertices, np.random.default_rng(seed).permutation(faces))
    bodies = split_bodies(whole)
    assert [body.volume for body in bodies] == pytest.approx([size**3 for size in sizes])


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_each_cavity_of_nested_spheres_belongs_to_the_shell_around_it(away: np.ndarray) -> None:
    first, second, third, fourth = (ball(radius, away) for radius in (5, 4, 3, 2))
    pairs = split_shells(Solid(*join(first, invert(second), third, invert(fourth))))
    assert [[shell.volume, *(cavity.volume for cavity in cavities)] for shell, cavities in pairs] == [
        pytest.approx([first.volume, second.volume]),
        pytest.approx([third.volume, fourth.volume]),
    ]


def test_a_body_counts_its_cavity_and_the_cavity_is_no_body() -> None:
    (body,) = split_bodies(Solid(*join(box(10), invert(box(4)))))
    (single,) = split_bodies(box(10))
    assert body.volume == pytest.approx(single.volume) == pytest.approx(1000)


def test_a_cavity_goes_to_the_body_around_it() -> None:
    pairs = split_shells(Solid(*join(box(4, (-20, 0, 0)), box(10), invert(box((2, 3, 4))))))
    assert {round(shell.volume): [round(cavity.volume) for cavity in cavities] for shell, cavities in pairs} == {
        64: [],
        1000: [24],
    }
