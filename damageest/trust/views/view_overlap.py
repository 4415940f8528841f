"""How far the views of a scan still differ where they overlap, in the whole scan and beside a site."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import INTACT, Floats, Ints
from damageest.geometry.neighbourhoods import find_in_box
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField
from damageest.trust.views.view_fit import number_views

AGREE = 0.6
"""Difference of the views, in tolerances, in four fifths of their overlap, up to which they agree."""
FEWEST_OF_VIEW = 4
"""Points of a view in a cube, for its mean to be compared."""
FEWEST_CUBES, FEWEST_BESIDE = 30, 6
"""Cubes of an overlap below which nothing is said of the whole scan, and of a site."""
LAYER = 5.0
"""Distance from the skin, in tolerances, up to which views are compared."""
BESIDE = 3.0
"""Width of the skin beside a site that is looked at, in widths of a cube."""


class _Means(NamedTuple):
    """The means of the views in cubes, K of them: ``cube``, ``mean`` and ``points`` (K,), their number."""

    cube: Ints
    mean: Floats
    points: Floats


def compare_views(field: ScanField, edge: float) -> float:
    """How far the mean distances of the views differ in cubes of width ``edge`` that several views show; 0 where they
    agree."""
    view = number_views(field.aligned)
    if view is None:
        return 0.0
    used = np.flatnonzero((view >= 0) & (np.abs(field.distance) < LAYER * field.tolerance))
    means = _average(field, view, used, edge)
    if not len(means.cube):
        return 0.0
    low, high = np.full(int(means.cube.max()) + 1, np.inf), np.full(int(means.cube.max()) + 1, -np.inf)
    np.minimum.at(low, means.cube, means.mean)
    np.maximum.at(high, means.cube, means.mean)
    shared = np.bincount(means.cube, minlength=len(low)) > 1
    if shared.sum() < FEWEST_CUBES:
        return 0.0
    apart = (high - low)[shared]
    return float(np.quantile(apart, 0.98)) if float(np.quantile(apart, 0.8)) > AGREE * field.tolerance else 0.0


def compare_at_site(field: ScanField, members: Ints, edge: float) -> float:
    """The standard deviation of a view against the others on intact skin beside the points ``members`` (M,) of a site,
    beyond what noise explains; 0 where only one view shows it."""
    view = number_views(field.aligned)
    if view is None or not len(members):
        return 0.0
    margin, own = BESIDE * edge, field.points[members]
    near = find_in_box(field.points, own.min(axis=0) - margin, own.max(axis=0) + margin)
    near = near[(view[near] >= 0) & (field.label[near] == INTACT)]
    means = _average(field, view, near, edge)
    if not len(means.cube):
        return 0.0
    cubes = np.bincount(means.cube)
    shared = cubes[means.cube] > 1
    if (cubes > 1).sum() < FEWEST_BESIDE:
        return 0.0
    cube, mean, count = means.cube[shared], means.mean[shared], means.points[shared]
    number = cubes[cube]
    middle = np.bincount(cube, mean) / np.maximum(np.bincount(cube), 1)
    noise = field.distance[near].std()
    found = ((mean - middle[cube]) ** 2 * number / (number - 1)).mean()
    return float(np.sqrt(max(found - (min(noise, field.aligned.noise) ** 2 / count).mean(), 0.0)))


def _average(field: ScanField, view: Ints, used: Ints, edge: float) -> _Means:
    """The mean distance of the ``used`` (U,) points of each view (N,) in each cube, of one side of a wall, where it has
    some."""
    if not len(used):
        return _Means(np.empty(0, np.int64), np.empty(0), np.empty(0))
    cubes = Patches.on_skin(field.points[used], field.find_normals(used), edge)
    of_views = cubes.split(view[used])
    many = of_views.count >= FEWEST_OF_VIEW
    mean = of_views.mean(field.distance[used])
    return _Means(cubes.group[of_views.first][many], mean[many], of_views.count[many].astype(np.float64))
