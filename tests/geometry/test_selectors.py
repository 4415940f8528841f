"""Selectors choose the skin that they name, and say what is wrong where they name none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from damageest.artefacts import Part
from damageest.errors import StageError
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.selectors import Selector
from tests import damaged_box

BOX = damaged_box.box()
NAMED = Part(
    BOX.vertices, BOX.faces, faces_brep=np.arange(12) // 2, face_names=tuple("abcdef"), face_kinds=("plane",) * 6
)


def choose(part: Part, **conditions: object) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points on the part, their normals and faces, and which of them a selector takes."""
    points, face = sample_by_area(part, 2000, np.random.default_rng(0))
    normals = part.face_normals[face]
    return points, normals, face, Selector.model_validate(conditions).matches(points, normals, face, part)


def test_facing_takes_the_skin_of_that_direction() -> None:
    _, normals, _, taken = choose(BOX, facing={"direction": [0, 0, 3]})
    assert (taken == (normals[:, 2] > 0.9)).all()


@settings(max_examples=25, deadline=None)
@given(st.floats(-15, 15), st.sampled_from(range(3)))
def test_a_half_space_and_its_opposite_share_the_skin(offset: float, axis: int) -> None:
    point, normal = np.zeros(3), np.eye(3)[axis]
    point[axis] = offset
    assume(abs(abs(offset) - np.abs(BOX.bounds[0, axis])) > 1e-9)  # skin in the plane itself belongs to neither
    one = choose(BOX, half_space={"point": point.tolist(), "normal": normal.tolist()})[3]
    other = choose(BOX, half_space={"point": point.tolist(), "normal": (-normal).tolist()})[3]
    assert (one ^ other).all()


def test_all_conditions_have_to_hold() -> None:
    points, normals, _, taken = choose(BOX, facing={"direction": [0, 0, 1]}, box=[[0, -100, -100], [100, 100, 100]])
    assert (taken == ((normals[:, 2] > 0.9) & (points[:, 0] > 0))).all()


def test_cad_faces_are_taken_by_number_and_by_name() -> None:
    _, _, face, by_number = choose(NAMED, faces=[1, 3])
    assert (by_number == np.isin(face // 2, [1, 3])).all()
    assert (choose(NAMED, faces=["b", "d"])[3] == by_number).all()


@pytest.mark.parametrize("part", [BOX, NAMED], ids=["mesh", "cad"])
def test_a_picked_point_takes_the_face_under_it(part: Part) -> None:
    points, normals, _, taken = choose(part, at=[20.3, 4, -3])
    assert (taken == (normals[:, 0] > 0.9)).all()
    assert points[taken][:, 0] == pytest.approx(20)
    with pytest.raises(StageError, match="from the part's skin"):
        choose(part, at=[25, 4, -3])


def test_an_unknown_face_names_the_valid_ones() -> None:
    with pytest.raises(StageError, match="b"):
        choose(NAMED, faces=["bb"])


@pytest.mark.parametrize(
    "wrong",
    [{}, {"facing": {"direction": [0, 0, 0]}}, {"box": [[1, 1, 1], [0, 0, 0]]}, {"boks": [[0, 0, 0], [1, 1, 1]]}],
)
def test_a_selector_that_can_select_nothing_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Selector.model_validate(wrong)
