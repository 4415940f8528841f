"""A displacement of metal as a lattice of cubic B-splines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from damageest.artefacts.arrays import Floats
from damageest.artefacts.fields import ArtefactError, Checked, Shape

DEGREE = 3


@dataclass(frozen=True, eq=False)
class DisplacementField(Checked):
    """The displacement of places in and around a part, in the part's frame and the job's unit.

    A free-form deformation (Sederberg and Parry 1986) with uniform cubic B-splines. ``low``, ``high`` (3,): corners of
    the box that the cells divide; ``controls`` (I,J,K,3): the coefficients, three more than cells along each axis.
    Outside the box the outermost cells go on.
    """

    low: Annotated[Floats, Shape(3)]
    high: Annotated[Floats, Shape(3)]
    controls: Annotated[Floats, Shape("I", "J", "K", 3)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.high > self.low).all():
            raise ArtefactError("high: not above low along each axis")
        if min(self.controls.shape[:3]) <= DEGREE:
            raise ArtefactError(f"controls: fewer than {DEGREE + 1} along an axis: {self.controls.shape[:3]}")

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells along the axes."""
        x, y, z = (count - DEGREE for count in self.controls.shape[:3])
        return x, y, z

    def displace(self, places: Floats) -> Floats:
        """(N,3) the displacement of places (N,3)."""
        return self._sum([self._evaluate(places, axis, 0) for axis in range(3)])

    def move(self, places: Floats) -> Floats:
        """(N,3) where places (N,3) of the part as designed are in the deformed part."""
        return np.asarray(places + self.displace(places))

    def differentiate(self, places: Floats) -> Floats:
        """(N,3,3) the deformation gradient: row k holds the derivatives of coordinate k after the deformation."""
        plain = [self._evaluate(places, axis, 0) for axis in range(3)]
        slopes = [
            self._sum([self._evaluate(places, axis, 1) if axis == along else plain[axis] for axis in range(3)])
            for along in range(3)
        ]
        return np.asarray(np.eye(3) + np.stack(slopes, axis=2))

    def _evaluate(self, places: Floats, axis: int, order: int) -> Floats:
        """(N,n) the functions of one coordinate, or their derivatives."""
        return evaluate_splines(places[:, axis], self.low[axis], self.high[axis], self.controls.shape[axis], order)

    def _sum(self, factors: list[Floats]) -> Floats:
        return np.asarray(np.einsum("ni,nj,nk,ijkc->nc", *factors, self.controls, optimize=True))


def evaluate_splines(along: Floats, low: float, high: float, count: int, order: int) -> Floats:
    """(N,count) the uniform cubic B-splines of a row of cells from ``low`` to ``high`` at coordinates (N,), or their
    derivatives of an ``order``."""
    from scipy.interpolate import BSpline

    spans = count - DEGREE
    knots = low + (high - low) * np.arange(-DEGREE, spans + DEGREE + 1) / spans
    return np.asarray(BSpline(knots, np.eye(count), DEGREE, extrapolate=True)(along, order))


def measure_roughness(shape: tuple[int, ...]) -> Floats:
    """(M,M) the sum of the squared third differences of the coefficients of a lattice with so many along each axis."""
    total = np.zeros((int(np.prod(shape)),) * 2)
    for axis, count in enumerate(shape):
        differences = np.diff(np.eye(count), n=DEGREE, axis=0)
        squares = [np.eye(each) for each in shape]
        squares[axis] = differences.T @ differences
        total += np.kron(np.kron(squares[0], squares[1]), squares[2])
    return total


def fit_displacement(
    displace: Callable[[Floats], Floats], low: Floats, high: Floats, cells: tuple[int, int, int]
) -> DisplacementField:
    """The field of so many cells in the box from ``low`` to ``high`` (3,) that is nearest to the displacements
    ``displace`` (N,3) of places (N,3), over a grid in the box. A polynomial of degree 3 is met exactly,
    by no cells too."""
    shape = tuple(max(1, count) + DEGREE for count in cells)
    field = DisplacementField(low, high, np.zeros((*shape, 3)))
    axes = [np.linspace(low[axis], high[axis], 2 * shape[axis]) for axis in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = displace(grid.reshape(-1, 3)).reshape(grid.shape)
    for axis, along in enumerate(axes):
        places = np.repeat(along[:, None], 3, axis=1)
        inverse = np.linalg.pinv(field._evaluate(places, axis, 0))
        values = np.moveaxis(np.tensordot(inverse, values, axes=(1, axis)), 0, axis)
    return DisplacementField(low, high, values)


def fit_scattered(
    places: Floats, displacement: Floats, low: Floats, high: Floats, cells: tuple[int, int, int], smooth: float
) -> DisplacementField:
    """The field of so many cells in the box from ``low`` to ``high`` (3,) that is nearest to the displacement (N,3) of
    places (N,3), and smooth where there are none: third differences of the coefficients count ``smooth`` times as much
    as places."""
    shape = tuple(max(1, count) + DEGREE for count in cells)
    field = DisplacementField(low, high, np.zeros((*shape, 3)))
    factors = [field._evaluate(places, axis, 0) for axis in range(3)]
    columns = np.einsum("ni,nj,nk->nijk", *factors).reshape(len(places), -1)
    rough = measure_roughness(shape) + 1e-6 * np.eye(columns.shape[1])
    found = np.linalg.solve(columns.T @ columns + smooth * len(places) * rough, columns.T @ displacement)
    return DisplacementField(low, high, found.reshape(*shape, 3))
