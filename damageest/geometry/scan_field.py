"""A scan that lies on a part, with how far each of its points is from the skin."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import INTACT, Deviation, Flags, Floats, Ints, Part, Scan
from damageest.geometry.distance import signed_distance


@dataclass(frozen=True, eq=False)
class ScanField:
    """What a scan of N points says about the skin of a part, at a tolerance in the part's unit.

    ``aligned``: the scan in the part's frame. ``deviation``: distance, nearest triangle and label of each of its
    points, as stage `segment` gives them. Here are also the figures that follow from these, so that there is one way
    to compute each of them.
    """

    part: Part
    aligned: Scan
    deviation: Deviation
    tolerance: float

    @classmethod
    def measure(cls, part: Part, aligned: Scan, tolerance: float) -> ScanField:
        """The field of a scan whose points have no labels yet: all count as intact."""
        distance, face = signed_distance(aligned.points, part)
        return cls(part, aligned, Deviation(distance, face, np.full(len(face), INTACT, np.uint8)), tolerance)

    @property
    def points(self) -> Floats:
        """(N,3) the scan points, in the part's frame."""
        return self.aligned.points

    @property
    def distance(self) -> Floats:
        """(N,) signed distance of each point to the skin, positive outside."""
        return self.deviation.distance

    @property
    def label(self) -> NDArray[np.uint8]:
        """(N,) label of each point: INTACT, DAMAGE, ADDED or OUTLIER."""
        return self.deviation.label

    @cached_property
    def intact(self) -> Floats:
        """(K,3) the points on the skin, which tell what is still there."""
        return np.asarray(self.points[self.label == INTACT])

    @cached_property
    def feet(self) -> Floats:
        """(N,3) the place on the skin below each point."""
        return self.find_feet(np.arange(len(self.points)))

    def find_feet(self, index: Ints | Flags) -> Floats:
        """(K,3) the places on the skin below some points: their numbers (K,), or whether each is asked (N,)."""
        feet = self.find_normals(index)  # in place: of a large scan, the copies would cost more than all else
        feet *= -self.distance[index, None]
        feet += self.points[index]
        return feet

    def find_normals(self, index: Ints | Flags) -> Floats:
        """(K,3) outward unit normals of the skin below some points, which are given as in `find_feet`."""
        return self.part.face_normals[self.deviation.face[index]]
