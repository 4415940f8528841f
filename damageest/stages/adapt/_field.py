"""A displacement field of the part, and its robust fit to a scan's points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh
from damageest.geometry.distance import SurfaceTree
from damageest.geometry.vectors import normalise
from damageest.stages.adapt._basis import Basis

INSIDE = 0.6
"""Weight of points inside the part, against those outside: loss and wear are inside."""
NOISE = 2.0
"""Depth, in standard deviations of a point, from which this holds: noise is on both sides."""
NEAREST = 0.3
"""How far the nearest place may lie off the normal of its triangle, as a share of the distance: beyond, it lies on an
edge, and says nothing about the skin beside it."""
STIFF = 1e-5
"""Strain that is as good as none."""
MEAN = 0.002
"""Strain, on average over the metal, of a field that does not stretch the part: a bend about an axis that is not its
middle has some."""
UNDO = 4
"""Rounds in which the place is found that a field moves to a point: its slope is below a tenth."""
SLENDER = 0.8
"""Variance of the metal along a main axis, as a share of that along another, from which it bends toward the other."""
STILL = 0.04
"""Largest movement of the skin in a round, in the body's step, by which a fit has come to rest."""
RIDGE = 1e-9
"""What keeps functions that nothing determines at 0, as a share of the largest sum of squares."""
ROUGH = 1e-6
"""Weight of the third differences of a lattice, as a share of the points' mean square: they only fill what neither
points nor strain determine."""


@dataclass(frozen=True, eq=False)
class Body:
    """What a field is fitted to the part by.

    ``mesh``: the part's skin as designed, of triangles small enough; ``inside`` (P,3): places in its metal where the
    strain is asked for. ``step``: the deviation that a strain of its bound counts like; ``noise``: standard deviation
    of the points. ``basis``: the functions of the fields that are fitted.
    """

    mesh: Mesh
    inside: Floats
    step: float
    noise: float
    basis: Basis

    @cached_property
    def tree(self) -> SurfaceTree:
        return SurfaceTree(self.mesh)

    @cached_property
    def normals(self) -> Floats:
        """(F,3) of the mesh's triangles."""
        return self.mesh.face_normals

    @cached_property
    def columns(self) -> Floats:
        """(V,M) the functions at the vertices."""
        return self.basis.evaluate(self.mesh.vertices)

    @cached_property
    def slopes(self) -> Floats:
        """(P,M,3) their derivatives at the places inside."""
        return self.basis.differentiate(self.inside)

    @cached_property
    def free_strain(self) -> Floats:
        """(P,3,3,S) the strains that cost nothing, see `make_free_strain`."""
        return make_free_strain(self.inside)


@dataclass(frozen=True, eq=False)
class Field:
    """A displacement of the part's metal: ``coefficients`` (M,3) of a basis, in the job's unit. ``growth``: the uniform
    scale that the strain is counted from, less 1."""

    basis: Basis
    coefficients: Floats
    growth: float = 0.0

    @classmethod
    def zero(cls, basis: Basis) -> Field:
        return cls(basis, np.zeros((basis.count, 3)))

    def displace(self, places: Floats) -> Floats:
        """(N,3) the displacement of places (N,3) on the part as designed."""
        return np.asarray(self.basis.evaluate(places) @ self.coefficients)

    def move(self, places: Floats) -> Floats:
        return places + self.displace(places)

    def undo(self, points: Floats) -> Floats:
        """(N,3) the places that are moved to the points (N,3), within a part in 10,000 of the displacement."""
        places = points
        for _ in range(UNDO):
            places = points - self.displace(places)
        return places

    def differentiate(self, places: Floats) -> Floats:
        """(N,3,3) the deformation gradient: row k holds the derivatives of coordinate k."""
        slopes = np.einsum("nma,mk->nka", self.basis.differentiate(places), self.coefficients)
        return np.asarray(np.eye(3) + slopes)

    def to_basis(self, basis: Basis, places: Floats) -> Field:
        """The same field by other functions, by least squares over places."""
        values, columns = self.displace(places), basis.evaluate(places)
        square = columns.T @ columns + 1e-9 * len(places) * (basis.roughness + RIDGE * np.eye(basis.count))
        return replace(self, basis=basis, coefficients=np.asarray(np.linalg.solve(square, columns.T @ values)))


@dataclass(frozen=True)
class Freedom:
    """How free a field is: ``bound``: the strain of the metal that counts like a deviation of the body's step; whether
    it ``grows`` all over; whether it ``bends`` and twists the part, of which the strain does not count; whether it
    ``stretches`` the part as a whole, more in one direction than in another; ``cells`` of its lattice, 0: a
    polynomial."""

    bound: float
    grows: bool = True
    bends: bool = True
    stretches: bool = False
    cells: int = 0


@dataclass(frozen=True, eq=False)
class Match:
    """Where points (N,3) lie on the deformed part: ``material`` (N,3) places on the part as designed, ``normal`` (N,3)
    of the deformed skin, ``distance`` (N,) signed, positive outside; ``faces_skin`` (N,): whether the nearest place is
    no edge's."""

    points: Floats
    material: Floats
    normal: Floats
    distance: Floats
    faces_skin: Flags


def match(field: Field, points: Floats, body: Body) -> Match:
    """The nearest places on the deformed part. They are looked for on the part as designed, where the points are taken
    back to: the field hardly strains the metal, and the tree of the part's triangles is built once."""
    _, face, material = body.tree.closest(field.undo(points))
    turned = np.linalg.solve(field.differentiate(material).transpose(0, 2, 1), body.normals[face][:, :, None])[:, :, 0]
    normal = normalise(np.asarray(turned, float))
    away = points - field.move(material)
    signed: Floats = np.einsum("ij,ij->i", away, normal)
    off = np.linalg.norm(away - signed[:, None] * normal, axis=1)
    return Match(
        points,
        material,
        np.asarray(normal, np.float64),
        signed,
        off <= NEAREST * np.maximum(np.abs(signed), 0.1 * body.step),
    )


def weigh(found: Match, scale: float, noise: float) -> Floats:
    """(N,) robust weights by Geman and McClure, smaller for points inside the part by more than noise."""
    side = np.where(found.distance < -NOISE * noise, INSIDE, 1.0)
    return np.asarray(side * found.faces_skin / (1 + (found.distance / scale) ** 2) ** 2)


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


def make_free_strain(places: Floats) -> Floats:
    """(P,3,3,S) strains at places (P,3) in a part that is bent or twisted, as an orthonormal basis over the places.

    Where an axis is bent to a curve, the metal on its outer side is longer and that on its inner side shorter, by its
    distance from the axis; where cross-sections turn, the metal is sheared. Neither changes how thick the part is, as
    wear does: of the main axes, one is bent toward those alone along which the part is no longer. Curvature and rate of
    turning may change in proportion to the place along the axis.
    """
    q = places - places.mean(axis=0)
    spread, frame = np.linalg.eigh(q.T @ q / len(q))
    q = q @ frame
    found = []
    for axis, toward in permutations(range(3), 2):
        for along in (np.ones(len(q)), q[:, axis]) if spread[axis] > SLENDER * spread[toward] else ():
            bent = np.zeros((len(q), 3, 3))
            bent[:, axis, axis] = along * q[:, toward]
            found.append(bent)
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        for along in (np.ones(len(q)), q[:, axis]):
            turned = np.zeros((len(q), 3, 3))
            turned[:, axis, one] = turned[:, one, axis] = -along * q[:, other]
            turned[:, axis, other] = turned[:, other, axis] = along * q[:, one]
            found.append(turned)
    flat = np.stack([(frame @ one @ frame.T).reshape(-1) for one in found], axis=1)
    u, size, _ = np.linalg.svd(flat / np.linalg.norm(flat, axis=0), full_matrices=False)
    kept = u[:, size > 1e-6 * size[0]] * np.sqrt(len(q))
    return np.asarray(kept.reshape(len(q), 3, 3, -1))


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
