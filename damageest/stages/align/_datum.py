"""The option `datum`: the faces that a pose is fitted to."""

from __future__ import annotations

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Flags, Part
from damageest.errors import StageError
from damageest.geometry.selectors import Selector

Datum = tuple[int | str | Selector, ...]
"""Numbers or names of CAD faces, or conditions that select skin; skin that one of them selects is part of it."""

NO_DATUM: Datum = Option(
    (),
    description="faces that fix the pose in the last fit, as an inspector aligns on datums: numbers or names of CAD "
    "faces, or selectors of skin (box, half_space, facing, faces, kind); what they do not fix is fixed by the rest, "
    "and said; default: all of the skin",
)


def find_datum(part: Part, datum: Datum) -> Flags | None:
    """Which triangles (F,) of the part belong to the datum; None where there is none.

    Raises StageError where the part has no such face, and where nothing is selected.
    """
    if not datum:
        return None
    centres = part.triangles.mean(axis=1)
    chosen = np.zeros(len(part.faces), bool)
    for item in datum:
        selector = item if isinstance(item, Selector) else Selector(faces=(item,))
        chosen |= selector.matches(centres, part.face_normals, np.arange(len(part.faces)), part)
    if not chosen.any():
        raise StageError("align.datum selects no skin of the part", "change its conditions, or name CAD faces")
    return chosen
