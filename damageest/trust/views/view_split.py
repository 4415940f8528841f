"""Whether a scan that does not say so holds several views that lie apart: by the order of its points, or by two
surfaces over the same skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Scan
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import number_cubes
from damageest.trust.form.form_fields import FieldFrame
from damageest.trust.form.form_fit import Skin, weigh
from damageest.trust.views.two_sheets import LEAST_NOISE, find_sheets
from damageest.trust.views.view_fit import (
    APART,
    BY_NOISE,
    COMPARED,
    FEWEST_SHARED,
    NARROWEST,
    REACH,
    FoundBy,
    number_views,
)
from damageest.trust.views.view_joint import PER_CELL, PER_PATCH, deal_patches

ASKED, LEAST_POINTS = 40_000, 1000
"""Points that are asked, and points below which nothing is separated."""
BLOCKS = 48
"""Shares of the order of the points, between which a view may end."""
NEAR = 3
"""Blocks before and after a cut in which its place is refined."""
MOST_VIEWS = 12
"""Views that are told from each other."""
FEWEST = 3
"""Points in a cell on each side, for it to be compared."""
TRIED = 6
"""Places between two views that are looked at, those that explain most."""
SORTED = 0.3
"""Correlation of the points' offsets with their places in the file, within cells, from which they were sorted."""
EXPLAINED = 0.3
"""Share of the cost of what lies apart that one motion has to explain."""
KEPT = 0.6
"""Share of that which it has to explain on patches that it was not fitted to."""
WIDTHS = (5.0, 2.0, 0.7)
"""Widths of the kernel, in tolerances, before the last."""
DOUBLE = 0.02
"""Share of the points at which the scan shows two surfaces, from which these may be two views."""
ALIKE = 0.2
"""What is left of the distance of both surfaces after one motion, in half of the places: share of it, at most."""
CLEAR = 2.0
"""Distance of both surfaces, in noises, from which a point tells which of them it is on."""
ON = 3.5
"""Distance from a surface, in noises, up to which a point is on it."""


@dataclass(frozen=True, eq=False)
class _Points:
    """Points of a scan straight over the skin, in their order: ``index`` (N,) in the scan, ``offset`` (N,) from the
    skin, ``jacobian`` (N,6), ``cell`` (N,) and ``patch`` (N,) of the skin."""

    index: Ints
    offset: Floats
    jacobian: Floats
    cell: Ints
    patch: Ints

    @classmethod
    def measure(cls, skin: Skin, part: Part, aligned: Scan, index: Ints, tolerance: float) -> _Points:
        """Those of the points ``index`` (M,) of the scan."""
        points = aligned.points[index]
        over, places, normals, offset = skin.find_over(points, REACH * tolerance, tolerance)
        index = index[over]
        frame = FieldFrame(part.bounds.mean(axis=0), np.eye(3), part.diagonal / 2)
        rows = frame.list_motions(points[over], normals)
        if not over.any():
            return cls(index, offset, rows, index, index)
        gap = float(np.sqrt(part.area / COMPARED))
        cell = Patches.on_skin(places, normals, PER_CELL * gap).group
        return cls(index, offset, rows, cell, number_cubes(places, PER_PATCH * gap)[1])


@dataclass(frozen=True, eq=False)
class _Apart:
    """How far two groups of points lie apart over the same skin, at K places: ``apart`` (K,), of the second from the
    first, outward, ``jacobian`` (K,6), ``weight`` (K,), ``patch`` (K,)."""

    apart: Floats
    jacobian: Floats
    weight: Floats
    patch: Ints

    def take(self, chosen: Flags) -> _Apart:
        return _Apart(self.apart[chosen], self.jacobian[chosen], self.weight[chosen], self.patch[chosen])

    def fit(self, width: float, tolerance: float) -> Floats:
        """The motion (6,) of the second group against the first; 0 where no place shows it."""
        motion: Floats = np.zeros(6)
        for wide in (*(max(factor * tolerance, width) for factor in WIDTHS), width, width):
            left = self.apart - self.jacobian @ motion
            rows = self.jacobian * (self.weight * weigh(left, wide))[:, None]
            hessian = rows.T @ self.jacobian
            hessian += np.eye(6) * 1e-3 * max(float(np.trace(hessian)), 1e-300) / 6
            motion = np.asarray(np.linalg.solve(hessian, rows.T @ self.apart), np.float64)
        return np.asarray(motion)

    def measure_cost(self, motion: Floats, width: float) -> float:
        """How badly the places agree after a motion (6,)."""
        size = ((self.apart - self.jacobian @ motion) / width) ** 2
        return float((self.weight * size / (1 + size)).sum())

    def is_rigid(self, motion: Floats, width: float, tolerance: float) -> bool:
        """Whether a motion explains that they lie apart, and does so where it was not fitted."""
        if len(self.apart) < FEWEST_SHARED or self.weight.sum() <= 0:
            return False
        if float(np.quantile(np.abs(self.jacobian @ motion), 0.8)) < APART * tolerance:
            return False
        before = self.measure_cost(np.zeros(6), width)
        if before - self.measure_cost(motion, width) < EXPLAINED * before:
            return False
        half = deal_patches(self.patch, 2) == 0
        gain = [0.0, 0.0]
        for out in (half, ~half):
            if not out.any() or out.all():
                return False
            test, other = self.take(out), self.take(~out)
            nothing = test.measure_cost(np.zeros(6), width)
            gain[0] += nothing - test.measure_cost(test.fit(width, tolerance), width)
            gain[1] += nothing - test.measure_cost(other.fit(width, tolerance), width)
        return gain[1] > KEPT * gain[0]


def separate_views(part: Part, aligned: Scan, tolerance: float) -> tuple[Ints, FoundBy] | None:
    """The view (N,) of each point, -1 where it is not told, and by what it was found: `order` or `sheets`.

    ``aligned``: the scan in the part's frame, the points in the order of the file. None where nothing shows that views
    lie apart: it is then one view, or several that agree. Views are separated only where one rigid motion between them
    explains, also where it was not fitted, that points over the same skin lie apart.
    """
    if number_views(aligned) is not None or len(aligned.points) < LEAST_POINTS:
        return None
    skin, width = Skin.build(part), max(NARROWEST * tolerance, BY_NOISE * aligned.noise)
    index = np.unique(np.linspace(0, len(aligned.points) - 1, min(ASKED, len(aligned.points))).astype(np.int64))
    points = _Points.measure(skin, part, aligned, index, tolerance)
    if len(points.index) < LEAST_POINTS:
        return None
    label = _separate_by_order(points, len(aligned.points), width, tolerance)
    if label is not None:
        return label, "order"
    label = _separate_by_sheets(skin, part, aligned, points, width, tolerance)
    return None if label is None else (label, "sheets")


def _separate_by_order(points: _Points, count: int, width: float, tolerance: float) -> Ints | None:
    """The view (N,) of each of ``count`` points, where views follow each other."""
    cuts: list[int] = []
    waiting = [(0, len(points.index))]
    while waiting and len(cuts) < MOST_VIEWS - 1:
        low, high = waiting.pop(0)
        cut = _find_cut(points, low, high, width, tolerance)
        if cut is not None:
            cuts.append(cut)
            waiting += [(low, cut), (cut, high)]
    if not cuts:
        return None
    ends = [0, *(int(points.index[cut]) for cut in sorted(cuts)), count]
    return np.repeat(np.arange(len(ends) - 1), np.diff(ends))


def _find_cut(points: _Points, low: int, high: int, width: float, tolerance: float) -> int | None:
    """Where one view ends and another begins between two places in the order; None where none does."""
    if high - low < LEAST_POINTS:
        return None
    block = np.arange(high - low) * BLOCKS // (high - low)
    cells = Patches.of_equal(points.cell[low:high])
    cell = cells.group
    columns = np.concatenate(
        [np.ones((high - low, 1)), points.offset[low:high, None], points.jacobian[low:high]], axis=1
    )
    sums = np.stack([cells.tabulate(block, BLOCKS, column) for column in columns.T])
    before = sums.cumsum(axis=2)
    patch = np.zeros(len(cells.count), np.int64)
    patch[cell] = points.patch[low:high]
    gains: list[tuple[float, int]] = []
    for k in range(1, BLOCKS):
        apart = _compare(before[:, :, k - 1], before[:, :, -1] - before[:, :, k - 1], patch)[0]
        if len(apart.apart) < FEWEST_SHARED:
            continue
        gain = apart.measure_cost(np.zeros(6), width) - apart.measure_cost(apart.fit(width, tolerance), width)
        gains.append((gain, k))
    for _, k in sorted(gains, reverse=True)[:TRIED]:
        apart, first, second = _compare(before[:, :, k - 1], before[:, :, -1] - before[:, :, k - 1], patch)
        if not apart.is_rigid(apart.fit(width, tolerance), width, tolerance):
            return None
        cut = _refine_cut(points.offset[low:high], cell, block, k, first, second, width)
        if not _is_sorted(points.offset[low:high], cell, cut, np.isfinite(first), width):
            return low + cut
    return None


def _is_sorted(offset: Floats, cell: Ints, cut: int, compared: Flags, width: float) -> bool:
    """Whether the points of a cell lie in the order of their offsets, before or after a cut: as in a file whose points
    are sorted along an axis, on a face across it. They lie apart since they were sorted."""
    order = np.arange(len(offset), dtype=np.float64)
    used = compared[cell]
    halves = Patches.of_equal(2 * cell[used] + (order[used] >= cut))
    group, count = halves.group, halves.count
    values = [np.clip(offset[used], -10 * width, 10 * width), order[used]]
    left = [one - halves.mean(one)[group] for one in values]
    # each cell counts by its own correlation: positions in the file differ by far more in some
    product, squares = np.bincount(group, left[0] * left[1]), [np.bincount(group, one**2) for one in left]
    each = product / np.sqrt(np.maximum(squares[0] * squares[1], 1e-300))
    return bool(np.abs(np.average(each, weights=count * (count > FEWEST))) > SORTED)


def _compare(first: Floats, second: Floats, patch: Ints) -> tuple[_Apart, Floats, Floats]:
    """How far the points after a cut lie from those before it, from sums (8,C) over cells, and the mean offsets (C,)
    of both, NaN where there are few points."""
    means = [sums[1:] / np.maximum(sums[0], 1) for sums in (first, second)]
    many = (first[0] >= FEWEST) & (second[0] >= FEWEST)
    weight = first[0] * second[0] / np.maximum(first[0] + second[0], 1)
    jacobian = (means[0][1:] + means[1][1:]).T / 2
    apart = _Apart(means[1][0] - means[0][0], jacobian, weight, patch).take(many)
    before, after = (np.where(many, mean[0], np.nan) for mean in means)
    return apart, before, after


def _refine_cut(offset: Floats, cell: Ints, block: Ints, k: int, first: Floats, second: Floats, width: float) -> int:
    """The place in the order, in the blocks near a cut, before which points lie with the first view."""
    near = np.flatnonzero((block >= k - NEAR) & (block < k + NEAR))
    better = np.minimum(np.abs(offset[near] - second[cell[near]]), 2 * width) - np.minimum(
        np.abs(offset[near] - first[cell[near]]), 2 * width
    )  # above 0: it lies with the first
    gain = np.concatenate([[0.0], np.cumsum(np.nan_to_num(better))])
    best = np.flatnonzero(gain >= gain.max() - 1e-12)
    return int(near[0] + best[len(best) // 2])


def _separate_by_sheets(
    skin: Skin, part: Part, aligned: Scan, points: _Points, width: float, tolerance: float
) -> Ints | None:
    """The view (N,) of each point, 0 for the upper surface and 1 for the lower, -1 for points on neither."""
    sheets = find_sheets(ScanField.measure(part, aligned.take(points.index), tolerance))
    if sheets.sheets.share < DOUBLE:
        return None
    double = sheets.places
    one = np.ones(len(double))
    jacobian, patch = points.jacobian[double], points.patch[double]
    apart = _Apart(-sheets.below, jacobian, one, patch)
    between = apart.fit(width, tolerance)
    if not apart.is_rigid(between, width, tolerance):
        return None
    left = float(np.median(np.abs(apart.apart - jacobian @ between)))
    if left > ALIKE * float(np.median(np.abs(apart.apart))):
        return None
    upper = _Apart(-sheets.upper, jacobian, one, patch).fit(width, tolerance)
    every = _Points.measure(skin, part, aligned, np.arange(len(aligned.points)), tolerance)
    noise = max(aligned.noise, LEAST_NOISE * tolerance)
    from_upper = np.abs(every.offset - every.jacobian @ upper)
    from_lower = np.abs(every.offset - every.jacobian @ (upper + between))
    is_told = np.abs(every.jacobian @ between) > CLEAR * noise
    label = np.full(len(aligned.points), -1)
    label[every.index[is_told & (from_upper < ON * noise) & (from_upper <= from_lower)]] = 0
    label[every.index[is_told & (from_lower < ON * noise) & (from_lower < from_upper)]] = 1
    return label
