"""The functions that a displacement field is a sum of: a full cubic polynomial, or a lattice of cubic B-splines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from damageest.artefacts import Floats, Ints, evaluate_splines, measure_roughness

DEGREE = 3


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions of material coordinates: places on the part as designed, centred at ``centre`` (3,) and divided by
    ``size``, half the part's largest extent. ``half`` (3,): half the part's extents, divided by ``size``. ``cells``: of
    the lattice along the largest extent; 0: a polynomial."""

    centre: Floats
    size: float
    half: Floats
    cells: int = 0

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """Functions along each axis; for a polynomial the powers from 0 up."""
        if not self.cells:
            return (DEGREE + 1,) * 3
        counts = np.maximum(1, np.ceil(self.half * self.cells - 1e-9)).astype(int) + DEGREE
        return int(counts[0]), int(counts[1]), int(counts[2])

    @cached_property
    def _powers(self) -> Ints:
        """(3,M) which function of each axis is multiplied: of a polynomial those up to the degree in all."""
        powers = np.array(list(product(*(range(n) for n in self.shape))))
        return np.asarray((powers if self.cells else powers[powers.sum(axis=1) <= DEGREE]).T)

    @property
    def count(self) -> int:
        return int(self._powers.shape[1])

    @property
    def shape_of_cells(self) -> tuple[int, int, int]:
        """Cells along the axes; 0 for a polynomial."""
        x, y, z = (n - DEGREE for n in self.shape)
        return (x, y, z) if self.cells else (0, 0, 0)

    def evaluate(self, places: Floats) -> Floats:
        """(N,M) the functions at places (N,3)."""
        return self._multiply([self._along(places, axis, 0) for axis in range(3)])

    def differentiate(self, places: Floats) -> Floats:
        """(N,M,3) their derivatives along the axes, per unit of length."""
        plain = [self._along(places, axis, 0) for axis in range(3)]
        slopes = []
        for axis in range(3):
            factors = list(plain)
            factors[axis] = self._along(places, axis, 1)
            slopes.append(self._multiply(factors))
        return np.stack(slopes, axis=2) / self.size

    def bound_curvature(self, places: Floats) -> Floats:
        """(N,M,6) their second derivatives xx, yy, zz, xy, xz, yz, per unit of length squared."""
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        out = []
        for pair in pairs:
            orders = [pair.count(axis) for axis in range(3)]
            out.append(self._multiply([self._along(places, axis, orders[axis]) for axis in range(3)]))
        return np.stack(out, axis=2) / self.size**2

    @cached_property
    def roughness(self) -> Floats:
        """(M,M) the sum of the squared third differences of a lattice; 0 for a polynomial."""
        if not self.cells:
            return np.zeros((self.count, self.count))
        return measure_roughness(self.shape)

    def _along(self, places: Floats, axis: int, order: int) -> Floats:
        """(N,n) the functions of one coordinate, or their derivatives, in scaled coordinates."""
        q = (places[:, axis] - self.centre[axis]) / self.size
        n = self.shape[axis]
        if not self.cells:
            columns = [np.zeros_like(q) for _ in range(n)]
            for power in range(order, n):
                factor = float(np.prod(np.arange(power, power - order, -1))) if order else 1.0
                columns[power] = factor * q ** (power - order)
            return np.stack(columns, axis=1)
        half = max(float(self.half[axis]), 1e-9)
        return evaluate_splines(q, -half, half, n, order)

    def _multiply(self, factors: list[Floats]) -> Floats:
        """(N,M) the products of one function an axis that are used."""
        i, j, k = self._powers
        return np.asarray(factors[0][:, i] * factors[1][:, j] * factors[2][:, k])
