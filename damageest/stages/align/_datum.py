"""The option `datum`: the faces that a pose is fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Flags, Floats, Ints, Part
from damageest.geometry.selectors import Selector

Datum = tuple[int | str | Selector, ...]
"""Numbers or names of CAD faces, or conditions that select skin; skin that one of them selects is part of it."""

NO_DATUM: Datum = Option(
    (),
    description="faces that fix the pose in the last fit, as an inspector aligns on datums: numbers or names of CAD "
    "faces, or selectors of skin (box, half_space, facing, faces, kind); what they do not fix is fixed by the rest, "
    "and reported; default: all of the skin",
)


@dataclass(frozen=True)
class DatumSkin:
    """The skin of ``part`` that the ``selectors`` choose."""

    part: Part
    selectors: tuple[Selector, ...]

    @classmethod
    def find(cls, part: Part, datum: Datum) -> DatumSkin | None:
        """The datum of a part, None where the job names none. Raises StageError where the part has no such face."""
        if not datum:
            return None
        found = cls(part, tuple(one if isinstance(one, Selector) else Selector(faces=(one,)) for one in datum))
        found.choose(np.zeros((1, 3)), np.zeros(1, np.int64))
        return found

    def choose(self, points: Floats, face: Ints) -> Flags:
        """Whether points (N,3) on the triangles ``face`` (N,), in the part's frame, belong to it (N,)."""
        normals = self.part.face_normals[face]
        chosen = [one.matches(points, normals, face, self.part) for one in self.selectors]
        return np.asarray(np.any(chosen, axis=0))
