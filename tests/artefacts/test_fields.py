"""Fields of values: type, shape and range from their annotations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest

from damageest.artefacts import Flags, Floats
from damageest.artefacts.fields import ArtefactError, Checked, NotNegative, Shape, Span


@dataclass(frozen=True, eq=False)
class Seen(Checked):
    points: Annotated[Floats, Shape("N", 3)]
    shown: Annotated[Flags | None, Shape("N")] = None
    distance: Annotated[Floats | None, Shape("N", finite=False)] = None
    width: Annotated[NotNegative, "a text"] = 0.0
    shares: Annotated[tuple[float, ...], Span(0.0, 1.0)] = ()


def test_arrays_have_the_type_of_their_annotation_and_cannot_be_changed() -> None:
    seen = Seen(np.zeros((2, 3), np.float32), shown=[1, 0])  # type: ignore[arg-type]
    assert seen.points.dtype == np.float64
    assert seen.shown is not None
    assert seen.shown.dtype == np.bool_
    assert not seen.points.flags.writeable


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"points": np.zeros((2, 2))}, r"points: expected \(N,3\), got \(2, 2\)"),
        ({"shown": np.zeros(3, bool)}, r"shown: expected \(2,\), got \(3,\)"),
        ({"points": np.full((2, 3), np.nan)}, "points: 6 of 6 are not finite numbers"),
        ({"width": -1.0}, "width: expected a number of at least 0, got -1.0"),
        ({"shares": (0.5, 2.0)}, "shares: expected a number from 0 to 1, got 2.0"),
    ],
)
def test_what_does_not_fit_is_named(given: dict[str, object], words: str) -> None:
    with pytest.raises(ArtefactError, match=words):
        Seen(**({"points": np.zeros((2, 3))} | given))  # type: ignore[arg-type]


def test_numbers_that_need_not_be_finite_may_be_missing() -> None:
    seen = Seen(np.zeros((2, 3)), distance=np.array([np.nan, 1.0]))
    assert seen.distance is not None
    assert np.isnan(seen.distance[0])
