"""How a damage volume depends on a free motion of the pose."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import FreeMotion, Part, Pose, Solid
from damageest.checks.free_pose import ask_free_pose, measure_dependence

LENGTH, WIDTH, HEIGHT, DEPTH = 40.0, 30.0, 20.0, 0.5


def make_slab() -> tuple[Part, Solid]:
    """A box, and the layer that it lost on top."""
    box = trimesh.creation.box((LENGTH, WIDTH, HEIGHT))
    layer = trimesh.creation.box((LENGTH, WIDTH, DEPTH))
    layer.apply_translation((0, 0, (HEIGHT - DEPTH) / 2))
    return Part(box.vertices, box.faces), Solid(layer.vertices, layer.faces)


@pytest.mark.parametrize(
    ("motion", "rate", "moved"),
    [
        (FreeMotion((0, 0, 1), -1, 1), -LENGTH * WIDTH, LENGTH * WIDTH),
        (FreeMotion((1, 0, 0), -1, 1), 0.0, 0.0),
        (FreeMotion((0, 1, 0), -1, 1, (-LENGTH / 2, 0, 0), 1 / LENGTH), LENGTH * WIDTH / 2, LENGTH * WIDTH / 2),
    ],
)
def test_rates_are_those_of_the_inner_surface(motion: FreeMotion, rate: float, moved: float) -> None:
    part, damage = make_slab()
    (found,) = measure_dependence(damage, part, Pose(np.eye(4), free=(motion,)))
    assert found.rate == pytest.approx(rate, abs=1e-6)
    assert found.moved == pytest.approx(moved, rel=0.05, abs=1e-6)


@pytest.mark.parametrize(("reach", "level"), [(0.005, "proven"), (0.03, "likely"), (0.4, "doubtful")])
def test_the_level_follows_from_the_share_of_the_volume(reach: float, level: str) -> None:
    part, damage = make_slab()
    pose = Pose(np.eye(4), free=(FreeMotion((0, 0, 1), -reach, 0.0),))
    against, questions = ask_free_pose(measure_dependence(damage, part, pose), damage.volume, "mm")
    assert {"proven": (0, 0), "likely": (0, 1), "doubtful": (1, 0)}[level] == (len(against), len(questions))
    for text in (*against, *questions):
        assert "(0.000, 0.000, 1.000)" in text
        assert f"{damage.volume:.4g}" in text


def test_a_pose_that_is_fixed_asks_nothing() -> None:
    part, damage = make_slab()
    assert measure_dependence(damage, part, Pose(np.eye(4))) == ()
