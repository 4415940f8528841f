"""A scan of a piece of the part in a known pose is told from a scan in another unit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats, Part
from damageest.geometry.pieces_of_part import is_piece
from damageest.geometry.sampling import sample_by_area

PLATE = trimesh.creation.box((100, 80, 12)).apply_translation((50, 40, 6))
PART = Part(PLATE.vertices, PLATE.faces)


def sample() -> Floats:
    return sample_by_area(PART, 20_000, np.random.default_rng(0))[0]


@pytest.mark.parametrize("middle", [(50, 40, 12), (90, 70, 12), (0, 40, 6)])
def test_a_piece_is_one_in_its_pose_only(middle: tuple[float, float, float]) -> None:
    points = sample()
    piece = points[np.linalg.norm(points - middle, axis=1) < 9]
    assert is_piece(piece, PART, np.eye(4))
    moved = np.eye(4)
    moved[:3, 3] = 5.0
    assert not is_piece(piece, PART, moved)


@pytest.mark.parametrize("factor", [1e-3, 0.1, 1 / 25.4])
@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_another_unit_is_none(factor: float, shift: float) -> None:
    """Also at a corner in the origin, where a tiny copy of the part lies on the skin of the part."""
    assert not is_piece(factor * (sample() + shift), PART, np.eye(4))


def test_no_points_are_no_piece() -> None:
    assert not is_piece(np.empty((0, 3)), PART, np.eye(4))
