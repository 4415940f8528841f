"""Points grouped into patches, and means over each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import group_integers
from damageest.geometry.voxels import number_cubes, number_faced_cubes


@dataclass(frozen=True, eq=False)
class Patches:
    """G groups of N points: the ``first`` point (G,) of each, and the ``count`` (G,) of its points; ``group`` (N,): the
    number of that of each point."""

    first: Ints
    group: Ints
    count: Ints

    @classmethod
    def of_equal(cls, numbers: Ints) -> Patches:
        """Points whose ``numbers`` (N,) are equal, in ascending order of these."""
        return cls(*group_integers(numbers))

    @classmethod
    def in_cubes(cls, points: Floats, edge: float) -> Patches:
        """Points (N,3) in one cube of a grid."""
        return cls.of_equal(number_cubes(points, edge)[1])

    @classmethod
    def on_skin(cls, points: Floats, normals: Floats, edge: float) -> Patches:
        """Points (N,3) in one cube of a grid whose normals (N,3) point to the same of six sides: of a thin wall, the
        two sides are two patches."""
        return cls.of_equal(number_faced_cubes(points, normals, edge)[1])

    def split(self, label: Ints) -> Patches:
        """The patches with points of another ``label`` (N,), 0 or more, apart: those of the views that show a patch."""
        return Patches.of_equal(self.group * (int(label.max(initial=0)) + 1) + label)

    def tabulate(self, label: Ints, count: int, values: Floats | None = None) -> Floats:
        """(G,L) the number of points of each ``label`` (N,), of ``count`` L, in each patch, or the sum of their
        ``values`` (N,): what each of some views shows of each patch."""
        size = len(self.count) * count
        return np.bincount(self.group * count + label, values, size).reshape(-1, count).astype(np.float64)

    def mean(self, values: Floats) -> Floats:
        """(G,) or (G,K) mean over the points of each patch, of values (N,) or (N,K)."""
        if values.ndim == 1:
            return np.asarray(np.bincount(self.group, weights=values) / self.count)
        sums = [np.bincount(self.group, weights=column) for column in values.T]
        return np.asarray(np.stack(sums, axis=1) / self.count[:, None])
