"""The skin of a part that its datum consists of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part
from damageest.geometry.selectors import Selector


@dataclass(frozen=True)
class DatumSkin:
    """The skin of ``part`` that the ``selectors`` choose."""

    part: Part
    selectors: tuple[Selector, ...]

    @classmethod
    def find(cls, part: Part, datum: tuple[int | str | Selector, ...]) -> DatumSkin:
        """The datum of a part. Raises StageError where the part has no such face."""
        found = cls(part, tuple(one if isinstance(one, Selector) else Selector(faces=(one,)) for one in datum))
        found.choose(np.zeros((1, 3)), np.zeros(1, np.int64))
        return found

    def choose(self, points: Floats, face: Ints) -> Flags:
        """Whether points (N,3) on the triangles ``face`` (N,), in the part's frame, belong to it (N,)."""
        normals = self.part.face_normals[face]
        chosen = [one.matches(points, normals, face, self.part) for one in self.selectors]
        return np.asarray(np.any(chosen, axis=0))
