"""The robust fit of a displacement field to a scan's points, by least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._field import RIDGE, Body, Field, Freedom, Match, match, weigh

MEAN = 0.002
"""Strain, on average over the metal, of a field that does not stretch the part: a bend about an axis that is not its
middle has some."""
STILL = 0.04
"""Largest movement of the skin in a round, in the body's step, by which a fit has come to rest."""
ROUGH = 1e-6
"""Weight of the third differences of a lattice, as a share of the points' mean square: they only fill what neither
points nor strain determine."""


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of a fit about a field: ``square`` (K,K) and ``right`` (K,) of the coefficients, point by
    point of each function, and the growth last."""

    square: Floats
    right: Floats

    def solve(self, basis: Basis, grows: bool) -> Field:
        """``grows``: whether the uniform scale is free."""
        square, right = self.stiffen(), self.right
        if grows:
            found: Floats = np.asarray(np.linalg.solve(square, right), np.float64)
            return Field(basis, found[:-1].reshape(-1, 3), float(found[-1]))
        still: Floats = np.asarray(np.linalg.solve(square[:-1, :-1], right[:-1]), np.float64)
        return Field(basis, still.reshape(-1, 3))

    def stiffen(self) -> Floats:
        """(K,K) the square with what keeps it from being singular."""
        scale = float(np.trace(self.square[:-1, :-1])) / max(len(self.square) - 1, 1)
        return np.asarray(self.square + RIDGE * scale * np.eye(len(self.square)))


def weigh_points(field: Field, found: Match, weights: Floats) -> Equations:
    """Point to plane: each point on the plane through its place, with the mean of the squares."""
    basis, count = field.basis, field.basis.count
    used = weights > 1e-4
    columns, normal, w = basis.evaluate(found.material[used]), found.normal[used], weights[used]
    target = np.einsum("ij,ij->i", normal, found.points[used] - found.material[used])
    square = np.zeros((count, 3, count, 3))
    for i in range(3):
        for j in range(i, 3):
            block = columns.T @ (columns * (w * normal[:, i] * normal[:, j])[:, None])
            square[:, i, :, j] = block
            square[:, j, :, i] = block.T
    right = columns.T @ (normal * (w * target)[:, None])
    size, total = 3 * count, max(len(weights), 1)
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size] = square.reshape(size, size) / total
    return Equations(whole, np.append(right.ravel() / total, 0.0))


def weigh_strain(field: Field, body: Body, freedom: Freedom) -> Equations:
    """The mean square of the strain, less that of a bend, a twist and a uniform growth, in units of its bound.
    Co-rotated about the field: a bend turns the metal by large angles. Where the field may not stretch the part, the
    mean strain is held near 0: that of a bend, a twist or a taper is, and that of a part with a worn face is not."""
    count, slopes = field.basis.count, body.slopes
    places, free = len(slopes), body.free_strain.shape[3] if freedom.bends else 0
    u, _, v = np.linalg.svd(np.eye(3) + np.einsum("nma,mk->nka", slopes, field.coefficients))
    turn = u @ v
    rows, right = [], []
    for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        # strain = sym(R' F) - (1 + growth) I - free strains, linear in the coefficients
        row = (slopes[:, :, None, a] * turn[:, None, :, b] + slopes[:, :, None, b] * turn[:, None, :, a]) / 2
        same = float(a == b)
        factor = 1.0 if same else np.sqrt(2.0)
        still = (turn[:, a, b] + turn[:, b, a]) / 2
        given = -body.free_strain[:, a, b, :free]
        columns = (row.reshape(places, 3 * count), np.full((places, 1), -same), given)
        rows.append(factor * np.concatenate(columns, axis=1))
        right.append(factor * (same - still))
    matrix, values = np.concatenate(rows), np.concatenate(right)
    factor = (body.step / freedom.bound) ** 2 / places
    square, aim = factor * matrix.T @ matrix, factor * matrix.T @ values
    if not freedom.stretches:
        whole = matrix[:, : 3 * count + 1]
        mean, target = whole.reshape(6, places, -1).mean(axis=1), values.reshape(6, -1).mean(axis=1)
        held = (body.step / min(MEAN, freedom.bound)) ** 2
        size = 3 * count + 1
        square[:size, :size] += held * mean.T @ mean
        aim[:size] += held * mean.T @ target
    return _eliminate(square, aim, 3 * count + 1)


def _eliminate(square: Floats, right: Floats, kept: int) -> Equations:
    """The equations of the first ``kept`` unknowns, with the others as they are best."""
    if len(square) == kept:
        return Equations(square, right)
    rest = square[kept:, kept:]
    solved = np.linalg.solve(rest, np.column_stack([square[kept:, :kept], right[kept:]]))
    return Equations(
        square[:kept, :kept] - square[:kept, kept:] @ solved[:, :-1],
        right[:kept] - square[:kept, kept:] @ solved[:, -1],
    )


def fit(field: Field, points: Floats, body: Body, freedom: Freedom, scales: Sequence[float]) -> Field:
    """The field after one round of matching and least squares for each of the robust ``scales``; of rounds at the same
    scale no more than it takes until the skin stays where it is."""
    before = 0.0
    for scale in scales:
        found = match(field, points, body)
        after = assemble(field, found, body, freedom, scale).solve(field.basis, freedom.grows)
        moved = float(np.abs(body.columns @ (after.coefficients - field.coefficients)).max())
        field = after
        if scale == before and moved < STILL * body.step:
            break
        before = scale
    return field


def assemble(field: Field, found: Match, body: Body, freedom: Freedom, scale: float) -> Equations:
    """The equations of points, strain and roughness together."""
    one, two = weigh_points(field, found, weigh(found, scale, body.noise)), weigh_strain(field, body, freedom)
    return Equations(one.square + two.square + weigh_roughness(field, one), one.right + two.right)


def weigh_roughness(field: Field, points: Equations) -> Floats:
    """(K,K) the third differences of a lattice, against the equations of the points."""
    square = np.zeros_like(points.square)
    if field.basis.cells:
        share = ROUGH * float(np.trace(points.square)) / len(points.square)
        square[:-1, :-1] = share * np.kron(field.basis.roughness, np.eye(3))
    return square
