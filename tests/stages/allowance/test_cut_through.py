"""A cavity that comes out on the other side of a wall is named, with the metal that was left."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Part, Solid
from damageest.geometry.solids import to_arrays
from damageest.stages.allowance.milling import Milling

WALL, TOLERANCE = 3.0, 0.1
PLATE = Manifold.cube((40, 30, WALL), True)
PART = Part(*to_arrays(PLATE), unit="mm")


def dent(depth: float) -> Solid:
    """What a ball of radius 6 takes out of the top of the plate."""
    return Solid(*to_arrays(PLATE ^ Manifold.sphere(6, 96).translate((2, 1, WALL / 2 + 6 - depth))))


def list_notes(depth: float, **options: Any) -> list[str]:
    deposit = Milling.model_validate({"outer": 0.5, **options}).run(dent(depth), PART, TOLERANCE, None)
    assert deposit is not None
    return [note for note in deposit.notes if "cuts through a wall" in note]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "options", [{"inner": 1.5}, pytest.param({"prepare": {"depth": 1.5, "min_radius": 0.5}}, marks=pytest.mark.slow)]
)
def test_a_wall_that_is_cut_through_is_named_with_what_was_left(options: dict[str, Any]) -> None:
    (note,) = list_notes(1.8, **options)
    left = float(note.partition("): ")[2].split()[0])
    assert left == pytest.approx(WALL - 1.8, abs=TOLERANCE)
    place = [float(word) for word in note.partition("(")[2].partition(")")[0].split(",")]
    assert np.abs(np.array(place) - (2, 1, -WALL / 2)).max() < 1.5


@pytest.mark.parametrize(
    "options", [{"inner": 0.6}, pytest.param({"prepare": {"depth": 0.6, "min_radius": 0.5}}, marks=pytest.mark.slow)]
)
def test_nothing_is_said_of_a_wall_that_stays(options: dict[str, Any]) -> None:
    assert not list_notes(1.8, **options)
