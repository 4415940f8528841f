"""Where the views of a scan lie against each other and against the part: one robust fit of all their motions.

Views are compared where they overlap, which wear does not disturb, since all of them see it; against the part with a
kernel that lets go of skin that lies inside, as wear does. Motions that neither shows are held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.patches import Patches
from damageest.geometry.voxels import number_cubes
from damageest.trust.form.form_fields import FieldFrame
from damageest.trust.form.form_fit import FEWEST, LARGEST, Skin, make_motion, weigh

WIDTHS = (8.0, 5.0, 3.0, 1.5, 0.7, 0.0)
"""Widths of the kernel, in tolerances, one after the other."""
OVERLAP = 4.0
"""Weight of the overlap of views against that of the part."""
CERTAIN = 0.15
"""Standard error of a motion, in tolerances where it moves the part most, up to which it is determined."""
POSE = 0.5
"""Weight of the pose, in views that show all points, where it is asked which views are misplaced."""
PER_CELL, PER_PATCH = 5.0, 25.0
"""Width of a cell, and of a patch that is left out to test the fit, in distances between the points."""
FOLDS = 4
"""Shares of the patches that are left out, one after the other."""


@dataclass(frozen=True, eq=False)
class ViewPoints:
    """Points (N,3) of a scan in the part's frame, the ``view`` (N,) of each, and the ``count`` of views."""

    points: Floats
    view: Ints
    count: int

    def move(self, moves: Floats) -> ViewPoints:
        """The points after the motions (V,4,4) of their views."""
        points = np.einsum("nij,nj->ni", moves[self.view, :3, :3], self.points) + moves[self.view, :3, 3]
        return ViewPoints(points, self.view, self.count)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Means over the points of one view in one cell of the skin, P of them: ``cell``, ``view``, ``patch`` (P,),
    ``offset`` (P,) from the skin, positive outside, ``jacobian`` (P,6), ``count`` (P,) of points. ``is_shared`` (P,):
    whether another view shows the cell."""

    cell: Ints
    view: Ints
    patch: Ints
    offset: Floats
    jacobian: Floats
    count: Floats
    is_shared: Flags

    def take(self, chosen: Flags) -> Pairs:
        """Some of the pairs."""
        names = ("cell", "view", "patch", "offset", "jacobian", "count", "is_shared")
        return Pairs(*(getattr(self, name)[chosen] for name in names))

    def shift(self, twists: Floats) -> Floats:
        """How far twists (V,6) of the views move the skin of each pair outward (P,)."""
        return np.asarray(np.einsum("pk,pk->p", self.jacobian, twists[self.view]))

    def differ(self, offset: Floats, weight: Floats | None = None) -> tuple[Floats, Floats, Ints]:
        """What offsets (P,) differ by from the mean of their cell, and the sum of weights (C,) and cell (P,)."""
        number = np.unique(self.cell, return_inverse=True)[1]
        weight = self.count if weight is None else weight
        total = np.maximum(np.bincount(number, weight), 1e-300)
        return offset - (np.bincount(number, weight * offset) / total)[number], total, number


@dataclass(frozen=True, eq=False)
class JointFit:
    """The motions of the views. ``twists`` (V,6): rotation vectors, as displacement at half the diagonal, and shifts,
    of the views against the part, with what no skin shows held; ``shown`` (V,6): the part of them that the overlap
    shows; ``common`` (6,): the motion of the view that most others lie with. ``free`` (V,6,6): projection of the
    motions of each view onto those that are held. ``pairs``: before the motions. ``kept``: share of what the motions
    explain that they also explain on patches that they were not fitted to."""

    twists: Floats
    shown: Floats
    free: Floats
    common: Floats
    pairs: Pairs
    kept: float
    frame: FieldFrame

    @property
    def held(self) -> Floats:
        """(V,) how many of six motions of each view are held."""
        return np.asarray(np.trace(self.free, axis1=1, axis2=2))

    @property
    def moves(self) -> Floats:
        """(V,4,4) the motions."""
        return np.array([make_motion(twist, self.frame) for twist in self.twists]).reshape(-1, 4, 4)


def pair_views(skin: Skin, frame: FieldFrame, seen: ViewPoints, gap: float, reach: float, tolerance: float) -> Pairs:
    """The pairs of points of views that lie within ``reach`` of the skin, straight over it."""
    over, places, normals, offset = skin.find_over(seen.points, reach, tolerance)
    points, view = seen.points[over], seen.view[over]
    if not len(points):
        none = np.empty(0, np.int64)
        return Pairs(none, none, none, np.empty(0), np.empty((0, 6)), np.empty(0), np.empty(0, bool))
    cells = Patches.on_skin(places, normals, PER_CELL * gap)
    of_views = cells.split(view)
    rows = np.concatenate([offset[:, None], frame.list_motions(points, normals)], axis=1)
    many = of_views.count >= FEWEST
    numbers = (cells.group, view, number_cubes(places, PER_PATCH * gap)[1])
    cell, view, patch = (one[of_views.first][many] for one in numbers)
    means, size = of_views.mean(rows)[many], of_views.count[many].astype(np.float64)
    shared = np.bincount(cell)[cell] > 1 if len(cell) else np.empty(0, bool)
    return Pairs(cell, view, patch, means[:, 0], means[:, 1:], size, shared)


def fit_jointly(
    skin: Skin, frame: FieldFrame, seen: ViewPoints, gap: float, width: float, reach: float, tolerance: float
) -> JointFit | None:
    """Fits views to each other and to the part, with a kernel that narrows to ``width`` (multi-view ICP with the part
    as one of the views; graduated non-convexity, Blake and Zisserman 1987). None where too little skin is seen."""
    count, before = seen.count, pair_views(skin, frame, seen, gap, reach, tolerance)
    if len(before.cell) < 12:
        return None
    moves = np.tile(np.eye(4), (count, 1, 1))
    pairs, wide = before, width
    for factor in WIDTHS:
        wide = max(factor * tolerance, width)
        pairs = pair_views(skin, frame, seen.move(moves), gap, reach, tolerance)
        if len(pairs.cell) < 12:
            return None
        twists = np.zeros((count, 6))
        for _ in range(3):
            hessian, gradient, _, _ = _sum_up(pairs, twists, count, wide)
            hessian += np.eye(6 * count) * _hold(pairs, wide, tolerance)
            twists = twists - np.linalg.solve(hessian, gradient).reshape(count, 6)
        moves = np.array([make_motion(twist, frame) @ move for twist, move in zip(twists, moves, strict=True)])
    hessian, _, scatter, overlap = _sum_up(pairs, np.zeros((count, 6)), count, wide)
    whole = _describe(moves, frame)
    common = whole[_choose_common(whole, np.bincount(pairs.view, pairs.count, count).astype(np.float64))]
    beyond = whole - common
    certain = _find_certain(hessian, scatter, tolerance)
    held = np.eye(6 * count) - certain @ certain.T
    kept = (certain @ (certain.T @ beyond.ravel())).reshape(count, 6)
    by_overlap = _find_certain(overlap, scatter / OVERLAP, tolerance)
    shown = (by_overlap @ (by_overlap.T @ kept.ravel())).reshape(count, 6)
    free = np.array([_leave_common(held, count, number) for number in range(count)])
    tested = _cross_validate(before, count, width, tolerance)
    return JointFit(kept + common, shown + common, free, common, before, tested, frame)


def _choose_common(twists: Floats, points: Floats) -> int:
    """The view (V,) that lies nearest to the others, weighted by their ``points`` (V,), and to the pose."""
    apart = np.linalg.norm(twists[:, None] - twists[None], axis=2)
    at_rest = POSE * points.sum() * np.linalg.norm(twists, axis=1)
    cost = np.where(points > 0, apart @ points + at_rest - 1e-9 * points, np.inf)
    return int(np.argmin(cost))


def _leave_common(held: Floats, count: int, number: int) -> Floats:
    """(6,6) what is held of one view, without what is held of all alike, as the turn of a shaft about its axis."""
    block = held.reshape(count, 6, count, 6)
    mean = block.mean(axis=(0, 2))
    return np.asarray(block[number, :, number, :] - mean)


def _hold(pairs: Pairs, width: float, tolerance: float) -> float:
    """What keeps motions that no skin shows near 0, in the scale of the weights."""
    return (width / (LARGEST * tolerance)) ** 2 * float(np.median(pairs.count)) + 1e-6 * float(pairs.count.mean())


def _sum_up(pairs: Pairs, twists: Floats, count: int, width: float) -> tuple[Floats, Floats, float, Floats]:
    """Hessian (6V,6V) and gradient (6V,) of the fit at twists (V,6), the variance of one point, and the share of the
    Hessian that the overlap gives."""
    offset = pairs.offset + pairs.shift(twists)
    weight = pairs.count * weigh(offset, width, True)
    hessian, gradient = np.zeros((count, 6, count, 6)), np.zeros((count, 6))
    _add_own(hessian, gradient, pairs, weight, offset)
    sums = np.array([(weight * offset**2).sum(), weight.sum(), (weight * pairs.count).sum()])
    overlap = np.zeros_like(hessian)
    if pairs.is_shared.any():
        some, left = pairs.take(pairs.is_shared), offset[pairs.is_shared]
        rough = some.differ(left)[0]
        weight = OVERLAP * some.count * weigh(rough, width)
        apart, total, number = some.differ(left, weight)
        _add_own(overlap, gradient, some, weight, apart)
        mean = np.zeros((len(total), count * 6))
        columns = 6 * some.view[:, None] + np.arange(6)
        np.add.at(mean, (number[:, None], columns), weight[:, None] * some.jacobian)
        overlap -= (mean.T @ (mean / total[:, None])).reshape(overlap.shape)
        plain = weight / OVERLAP
        sums += [(plain * apart**2).sum(), plain.sum(), (plain * some.count).sum()]
    variance = sums[0] * sums[2] / max(sums[1], 1e-300) ** 2
    size = 6 * count
    return (
        (hessian + overlap).reshape(size, size), gradient.ravel(), float(variance), overlap.reshape(size, size)
    )  # fmt: skip


def _add_own(hessian: Floats, gradient: Floats, pairs: Pairs, weight: Floats, offset: Floats) -> None:
    for number in np.unique(pairs.view):
        own = pairs.view == number
        rows = pairs.jacobian[own] * weight[own, None]
        hessian[number, :, number, :] += rows.T @ pairs.jacobian[own]
        gradient[number] += rows.T @ offset[own]


def _find_certain(hessian: Floats, variance: float, tolerance: float) -> Floats:
    """(6V,K) the motions whose standard error is small."""
    size, motions = np.linalg.eigh(hessian)
    error = np.sqrt(variance / np.maximum(size, 1e-300))
    return np.asarray(motions[:, error < CERTAIN * tolerance])


def deal_patches(patch: Ints, count: int) -> Ints:
    """Which of ``count`` shares each of some patches (N,) is in: neighbours in any, the same in each run."""
    return np.asarray(patch * 2654435761 % 1048573 % count)


def _cross_validate(pairs: Pairs, count: int, width: float, tolerance: float) -> float:
    """Share of the cost that the motions explain which they also explain on patches that they were not fitted to. Above
    that of one motion of all views."""
    fold = deal_patches(pairs.patch, FOLDS)
    gain = [0.0, 0.0]
    for number in range(FOLDS):
        out = fold == number
        for k, (fitted, asked) in enumerate(((pairs, out), (pairs.take(~out), out))):
            twists, alike = (_fit_linear(fitted, count, width, tolerance, is_common) for is_common in (False, True))
            test = pairs.take(asked)
            gain[k] += _measure_cost(test, alike, width) - _measure_cost(test, twists, width)
    return gain[1] / gain[0] if gain[0] > 0 else 0.0


def _fit_linear(pairs: Pairs, count: int, width: float, tolerance: float, is_common: bool) -> Floats:
    """The twists (V,6) of views, or of all views alike, from the offsets as they are."""
    all_alike = np.tile(np.eye(6), (count, 1))
    twists = np.zeros((count, 6))
    for factor in WIDTHS:
        wide = max(factor * tolerance, width)
        hessian, gradient, _, _ = _sum_up(pairs, twists, count, wide)
        hessian += np.eye(6 * count) * _hold(pairs, wide, tolerance)
        if is_common:
            step = all_alike @ np.linalg.solve(all_alike.T @ hessian @ all_alike, all_alike.T @ gradient)
        else:
            step = np.linalg.solve(hessian, gradient)
        twists = twists - step.reshape(count, 6)
    return twists


def _measure_cost(pairs: Pairs, twists: Floats, width: float) -> float:
    """How badly pairs fit to the part, and to each other, after the twists."""
    offset = pairs.offset + pairs.shift(twists)
    apart = pairs.differ(offset)[0] if len(offset) else offset
    cost = 0.0
    for values, factor in ((offset, 1.0), (apart, OVERLAP)):
        size = (values / width) ** 2
        cost += factor * float((pairs.count * size / (1 + size)).sum())
    return cost


def _describe(moves: Floats, frame: FieldFrame) -> Floats:
    """The twists (V,6) of motions (V,4,4), as `make_motion` takes them."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(moves[:, :3, :3]).as_rotvec() * frame.half
    shifts = moves[:, :3, :3] @ frame.centre + moves[:, :3, 3] - frame.centre
    return np.concatenate([turns, shifts], axis=1)
