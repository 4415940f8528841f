"""The capsule is as short as the part allows."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Part
from damageest.stages.background.capsule import Capsule
from tests.stages._open import bowl
from tests.stages.background.holding import box, dent, measure_gap, measure_longest_edge


def test_the_capsule_round_a_ball_is_a_ball() -> None:
    ball = trimesh.creation.icosphere(4, 10)
    part = Part(ball.vertices, ball.faces)
    found = Capsule().run(part, bowl(3, 8, 0.5), 0.5, 0.1, False)
    assert found.volume == pytest.approx(4 / 3 * np.pi * 11**3, rel=0.02)


def test_holds_a_block_of_any_shape() -> None:
    for size in [(40, 30, 20), (5, 80, 5), (60, 60, 4)]:
        part, surface = box(size), dent(size[2] / 2)  # type: ignore[arg-type]
        nearest, holds = measure_gap(Capsule().run(part, surface, 0.5, 0.1, False), part, surface)
        assert holds
        assert nearest > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", ["loop", "adaptive", *(pytest.param(how, marks=pytest.mark.slow) for how in ("linear", "butterfly"))]
)
def test_every_subdivision_holds_the_part(how: str) -> None:
    """A capsule has no sharp corners, so the smoothing subdivisions keep its shape."""
    found = Capsule.model_validate({"use": "capsule", "subdivide": how}).run(box(), dent(), 0.5, 0.1, True)
    assert measure_longest_edge(found) <= 1.5 * 1.001
    assert measure_gap(found, box(), dent())[1]
