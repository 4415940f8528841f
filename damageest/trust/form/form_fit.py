"""Robust fit of a rigid motion and a field of displacement to the points on the skin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.distance import SurfaceTree, keep_tree
from damageest.geometry.patches import Patches
from damageest.geometry.transforms import make_motions, move_points
from damageest.trust.form.form_fields import Field, FieldFrame

FEWEST = 3
"""Points in a cell, for its mean to count."""
LARGEST = 60.0
"""Standard deviation of a coefficient before the fit, in tolerances: keeps what the points do not show near 0."""
NEAREST = 0.25
"""How far the nearest place on the skin may lie off the line along its normal, in tolerances: farther, it lies on an
edge, and says nothing about the skin beside it."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The part's skin moved to the origin, for queries: ``tree``, unit ``normals`` (F,3) of its faces, and ``origin``
    (3,), where the part's own origin is."""

    tree: SurfaceTree
    normals: Floats
    origin: Floats

    @classmethod
    def build(cls, part: Mesh) -> Skin:
        return cls(keep_tree(part), part.face_normals, part.bounds.mean(axis=0))

    def find_feet(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """For points (N,3) in the part's frame: distance (N,), nearest places (N,3) and the skin's normals there."""
        distance, face, place = self.tree.closest(points - self.origin)
        return distance, place + self.origin, self.normals[face]

    def find_over(self, points: Floats, reach: float, tolerance: float) -> tuple[Flags, Floats, Floats, Floats]:
        """Which of points (N,3) lie within ``reach`` of the skin and straight over it, not beside an edge; and of
        these, K of them, the nearest places (K,3), the normals there (K,3) and the offsets (K,), positive outside."""
        distance, places, normals = self.find_feet(points)
        offset = np.einsum("ij,ij->i", normals, points - places)
        over = (distance < reach) & (np.sqrt(np.maximum(distance**2 - offset**2, 0)) < NEAREST * tolerance)
        return over, places[over], normals[over], offset[over]


@dataclass(frozen=True, eq=False)
class Form:
    """How the scan differs from the part: a rigid motion ``T`` (4,4) of the scan, and then a displacement of the skin
    by ``fields`` with their ``coefficients`` (K,), in the job's unit. ``covariance`` (6+K,6+K) of both."""

    frame: FieldFrame
    T: Floats
    fields: tuple[Field, ...]
    coefficients: Floats
    covariance: Floats

    @classmethod
    def rigid(cls, frame: FieldFrame) -> Form:
        return cls(frame, np.eye(4), (), np.empty(0), np.zeros((6, 6)))

    def with_fields(self, fields: tuple[Field, ...]) -> Form:
        """The form with other fields; those that it has keep their coefficients, the others have 0."""
        known = dict(zip(self.fields, self.coefficients, strict=True))
        return replace(self, fields=fields, coefficients=np.array([known.get(field, 0.0) for field in fields]))

    def undo(self, points: Floats) -> Floats:
        """Where the scan's points (N,3) would be on a part as designed."""
        moved = move_points(points, self.T)
        if not len(self.fields):
            return np.asarray(moved)
        back = moved
        for _ in range(3):
            back = moved - self.frame.sum_up(self.fields, self.coefficients, back)
        return np.asarray(back)

    def displace(self, places: Floats) -> Floats:
        """The displacement (N,3) of places (N,3) on the part by the fields, without the motion."""
        return self.frame.sum_up(self.fields, self.coefficients, places)


@dataclass(frozen=True, eq=False)
class Cells:
    """Means over cells of the skin, C of them: ``offset`` (C,) signed distance from the skin, positive outside,
    ``jacobian`` (C,6+K), ``count`` (C,) of points, ``place`` (C,3), ``normal`` (C,3)."""

    offset: Floats
    jacobian: Floats
    count: Floats
    place: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class Feet:
    """Scan points (N,3) with the nearest places on the skin, the normals there, and the cell (N,) of each."""

    points: Floats
    places: Floats
    normals: Floats
    cell: Ints

    @cached_property
    def count(self) -> Floats:
        return np.bincount(self.cell).astype(np.float64)

    def mean(self, values: Floats) -> Floats:
        """The mean of values (N,K) over the cells (C,K)."""
        sums = np.stack([np.bincount(self.cell, column) for column in values.T], axis=1)
        return np.asarray(sums / self.count[:, None])

    def summarise(self, form: Form) -> Cells:
        """The means over the cells of what is left of the points' distances after a form is undone."""
        back = form.undo(self.points)
        offset = np.einsum("ij,ij->i", self.normals, back - self.places)
        rigid = form.frame.list_motions(back, self.normals)
        bent = -np.einsum("nj,knj->nk", self.normals, form.frame.evaluate(form.fields, back))
        means = self.mean(np.concatenate([offset[:, None], rigid, bent, self.places, self.normals], axis=1))
        size = 6 + len(form.fields)
        kept = self.count >= FEWEST
        means = means[kept]
        return Cells(
            means[:, 0], means[:, 1 : 1 + size], self.count[kept], means[:, 1 + size : 4 + size], means[:, 4 + size :]
        )


def find_feet(skin: Skin, form: Form, points: Floats, edge: float, reach: float, tolerance: float) -> Feet:
    """The nearest places on the skin of points (N,3) after a form is undone; without points farther than ``reach`` and
    without those beside an edge. Cells have the width ``edge``."""
    back = form.undo(points)
    over, places, normals, _ = skin.find_over(back, reach, tolerance)
    if not over.any():
        return Feet(points[over], places, normals, np.empty(0, np.int64))
    return Feet(points[over], places, normals, Patches.on_skin(places, normals, edge).group)


def weigh(offset: Floats, width: float, is_one_sided: bool = False) -> Floats:
    """Weights (C,) of Geman and McClure's kernel; ``is_one_sided``: outside the skin those of Huber's, since no loss
    puts points there."""
    weight = (width**2 / (width**2 + offset**2)) ** 2
    if not is_one_sided:
        return np.asarray(weight)
    return np.where(offset > 0, np.minimum(1.0, width / np.maximum(offset, 1e-300)), weight)


def solve_cells(
    J: Floats, offset: Floats, weight: Floats, count: Floats, width: float, tolerance: float
) -> tuple[Floats, Floats]:
    """The step (K,) that brings the offsets (C,) of cells nearest to 0, with their Jacobian (C,K) and weights (C,), and
    its covariance (K,K), from what is left of the weighted offsets."""
    hessian = J.T @ (J * weight[:, None])
    # the coefficients' size before the fit: in the scale of the weights, as if it were as many points as a cell has
    prior = (width / (LARGEST * tolerance)) ** 2 * float(np.median(count)) + 1e-7 * float(np.trace(hessian))
    hessian += np.diag(np.full(len(hessian), prior))
    total = max(float(weight.sum()), 1e-300)
    spread, per_cell = float((weight * offset**2).sum()) / total, float((weight * count).sum()) / total
    step = -np.linalg.solve(hessian, J.T @ (weight * offset))
    return np.asarray(step), np.asarray(np.linalg.inv(hessian) * spread * per_cell)


def improve(form: Form, cells: Cells, width: float, tolerance: float) -> Form:
    """One Gauss-Newton step of a form, with the cells weighted by the kernel of ``width``."""
    weight = cells.count * weigh(cells.offset, width)
    step, covariance = solve_cells(cells.jacobian, cells.offset, weight, cells.count, width, tolerance)
    return replace(
        form,
        T=make_motion(step[:6], form.frame) @ form.T,
        coefficients=form.coefficients + step[6:],
        covariance=covariance,
    )


def make_motion(twist: Floats, frame: FieldFrame) -> Floats:
    """The rigid motion (4,4) of a rotation vector, as displacement at half the diagonal from the centre, and a
    translation."""
    motion: Floats = make_motions(np.concatenate([twist[:3] / frame.half, twist[3:]])[None])[0]
    motion[:3, 3] += frame.centre - motion[:3, :3] @ frame.centre
    return motion


def measure_cost(offset: Floats, count: Floats, width: float) -> float:
    """The mean cost of cells with these offsets (C,): 0 on the skin, 1 deeper than the width, where metal may be lost,
    up to 2 outside, where no loss explains them."""
    size = (offset / width) ** 2
    cost = size / (1 + size) * np.where(offset > 0, 2.0, 1.0)
    return float((cost * count).sum() / max(float(count.sum()), 1e-300))
