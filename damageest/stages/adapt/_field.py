"""A displacement field of the part, and the places on the part's skin that it moves to a scan's points."""

from __future__ import annotations

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
UNDO = 4
"""Rounds in which the place is found that a field moves to a point: its slope is below a tenth."""
SLENDER = 0.8
"""Variance of the metal along a main axis, as a share of that along another, from which it bends toward the other."""
RIDGE = 1e-9
"""What keeps functions that nothing determines at 0, as a share of the largest sum of squares."""


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
