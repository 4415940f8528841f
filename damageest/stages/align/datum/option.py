"""The option `datum`: the faces that a pose is fitted to, together or as a system with precedence."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field as Option
from pydantic import StringConstraints

from damageest.geometry.selectors import Selector, StrictMapping

Item = int | str | Selector
Items = Annotated[tuple[Item, ...], Option(min_length=1)]


class DatumFeature(StrictMapping):
    """One datum of a system, with how it is fitted."""

    skin: Items = Option(description="numbers or names of CAD faces, or selectors of skin")
    fit: Literal["robust", "one_sided"] = Option(
        "robust",
        description="robust: least squares to unworn points; one_sided: from outside, like a surface plate on "
        "a face, a ring on a shaft or a plug in a bore",
    )


Letter = Annotated[str, StringConstraints(pattern=r"^[A-Z]{1,2}$")]
System = Annotated[dict[Letter, Items | DatumFeature], Option(min_length=1, max_length=3)]
"""Datums by letter, in the order of precedence."""
Datum = tuple[Item, ...] | System
"""Numbers or names of CAD faces, or conditions that select skin; skin that one of them selects is part of it. Or
several such lists by letter, the first of which fixes all that it can."""

NO_DATUM: Datum = Option(
    (),
    description="faces that fix the pose in the last fit: numbers or names of CAD "
    "faces, or selectors of skin (box, half_space, facing, faces, at, kind); other skin "
    "fixes the rest; default: all skin. Or a datum system with precedence: {A: [...], B: [...], C: [...]} "
    "(ISO 5459, ASME Y14.5)",
)
