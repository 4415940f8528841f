"""Depth in steps: many depth cameras give whole multiples of a step, as 1 mm, in which no noise can be measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats

MOST = 40_000
"""Points that directions are tried with."""
MIN_POINTS = 1000
MIN_VALUES, POINTS_PER_VALUE, MIN_SHARE = 4, 12, 0.2
"""In steps, a direction has at least so many values with so many points each; together a share of all points."""
SAME = 2e-5
"""Largest difference of values that are the same, in extents of the scan along the direction."""
SLOPE = (0.2, 0.95)
"""Least and largest cosine of the angle between direction and surface normal where steps show in the surface."""
PATCHES, NEIGHBOURS, MIN_NEIGHBOURS = 400, 200, 24
"""Number of patches of the surface that are looked at, and the largest and smallest number of points of each."""
WIDTH = 5.0
"""Radius of a patch, in steps; smaller ones show a single terrace."""
AGREE = 0.6
"""Least deviation of sloping patches, in that of terraces."""
ON_VALUES = 0.8
"""Share of a patch's points that have a value that many have, where its depth is in steps."""
MOST_SMOOTH = 0.1
"""Largest share of small patches that are exactly plane and no terraces."""
REGULAR = 0.7
"""Share of the differences between values that must be multiples of the step, to 15 %."""
FLAT = 1e-4
"""Largest deviation from a plane of a small patch that lies on one terrace, in its width."""


def measure_depth_step(
    points: Floats, viewpoints: Floats | None = None, view: NDArray[np.int32] | None = None
) -> float:
    """The step of the depth of a scan with ``points`` (N,3), in the unit of the points; 0 where it is continuous.

    Tried are the coordinate axes; the normals of small patches that are exactly plane, which are the terraces of a scan
    that was turned; and the distance from the scanner, where the ``view`` (N,) of each point and the ``viewpoints``
    (V,3) are known. A direction in which many points have few values is one of depth in steps if sloping surface
    deviates from a smooth one as terraces do, by step / sqrt(12). A regular raster does not: there the step is the
    pitch. A step smaller than 1/3000 of the scan's extent is not found.
    """
    points = np.asarray(points, dtype=np.float64)
    if len(points) < MIN_POINTS or not np.isfinite(points).all():
        return 0.0
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(0)
    chosen = rng.choice(len(points), min(MOST, len(points)), replace=False)
    middle = points.mean(axis=0)
    some = points[chosen] - middle
    candidates = [(some @ way, np.broadcast_to(way, some.shape)) for way in np.eye(3)]
    if viewpoints is not None and view is not None:
        seen = view[chosen] >= 0
        way = some - (viewpoints[np.maximum(view[chosen], 0)] - middle)
        length = np.linalg.norm(way, axis=1)
        rest = rng.uniform(0, length.max(), len(some))  # points of no known view agree with no step
        candidates.append((np.where(seen, length, rest), way / np.maximum(length, 1e-300)[:, None]))
    # All points around few places: a tree over very many points takes seconds.
    tree = cKDTree(points - middle if len(points) <= 5 * MOST else some)
    candidates += [(some @ way, np.broadcast_to(way, some.shape)) for way in _find_terraces(tree, some)]
    found = [(*_find_step(values), way) for values, way in candidates]
    return max((step for step, on, way in found if step and _is_terraced(tree, some, way, step, on)), default=0.0)


def _find_terraces(tree: object, some: Floats) -> list[Floats]:
    """Up to two normals (3,) that many small, exactly plane patches have in common; none along an axis."""
    plane, normals = _find_planes(tree, some[: 5 * PATCHES])
    normals = normals[plane]
    found: list[Floats] = []
    while len(found) < 2 and len(normals) >= 20:
        alike = np.abs(normals @ normals.T) > 1 - 1e-5
        best = alike[int(np.argmax(alike.sum(axis=1)))]
        if best.sum() < 20:
            break
        way = np.linalg.eigh(normals[best].T @ normals[best])[1][:, 2]
        if np.abs(way).max() < 1 - 1e-8:
            found.append(way)
        normals = normals[~best]
    return found


def _find_planes(tree: object, places: Floats) -> tuple[Flags, Floats]:
    """Whether the smallest patch around each place (M,3) is exactly plane, and its normal (M,3)."""
    _, index = tree.query(places, k=12)  # type: ignore[attr-defined]
    around = tree.data[index]  # type: ignore[attr-defined]
    around = around - around.mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", around, around))
    return (spread[:, 0] < FLAT**2 * spread[:, 1]) & (spread[:, 1] > 0.02 * spread[:, 2]), axes[:, :, 0]


def _find_step(values: Floats) -> tuple[float, Flags]:
    """The typical difference between the values (N,) that many of the points share, 0 where there are few such values;
    and whether each point has one of them."""
    extent, none = float(np.ptp(values)), np.zeros(len(values), bool)
    if not extent > 0:
        return 0.0, none
    order = np.argsort(values)
    values = values[order]
    group = np.concatenate([[0], np.cumsum(np.diff(values) > SAME * extent)])
    count = np.bincount(group)
    many = count >= POINTS_PER_VALUE
    # A group is one value only where it is narrow: dense continuous values follow each other as closely.
    last = np.cumsum(count) - 1
    many &= values[last] - values[last - count + 1] < 10 * SAME * extent
    if many.sum() < MIN_VALUES or count[many].sum() < MIN_SHARE * len(values):
        return 0.0, none
    on = none.copy()
    on[order] = many[group]
    gaps = np.diff(values[last[many]])
    step = float(np.median(gaps))
    times = gaps / step
    regular = (np.abs(times - np.rint(times)) < 0.15) & (times > 0.5)
    return (step if regular.mean() >= REGULAR else 0.0), on


def _is_terraced(tree: object, some: Floats, way: Floats, step: float, on: Flags) -> bool:
    """Whether sloping surface deviates from a smooth one as it does with depth in steps along ``way`` (N,3).

    ``on`` (N,): which points have a value that many have. Across an edge, a surface deviates as much. But where only a
    wall is in rows along ``way``, and what it meets is not, few points of a patch are ``on``; and where nothing has
    noise, walls are exactly plane in the small.
    """
    from scipy.spatial import cKDTree

    shown = cKDTree(some)
    plane, normals = _find_planes(tree, some[:PATCHES])
    smooth = plane & (np.abs(np.einsum("ij,ij->i", normals, way[:PATCHES])) < SLOPE[1])
    if smooth.mean() > MOST_SMOOTH:
        return False
    reach = WIDTH * step
    rng = np.random.default_rng(1)
    ratios = []
    for place, direction in zip(some[:PATCHES], way[:PATCHES], strict=True):
        near = np.asarray(tree.query_ball_point(place, reach), dtype=np.int64)  # type: ignore[attr-defined]
        if len(near) < MIN_NEIGHBOURS:
            continue
        if len(near) > NEIGHBOURS:
            near = near[rng.permutation(len(near))[:NEIGHBOURS]]
        local = tree.data[near] - place  # type: ignore[attr-defined]
        local = local - local.mean(axis=0)
        axes = np.linalg.eigh(local.T @ local)[1]
        cosine = abs(float(axes[:, 0] @ direction))
        if not SLOPE[0] < cosine < SLOPE[1]:
            continue
        if on[shown.query_ball_point(place, reach)].mean() < ON_VALUES:
            ratios.append(0.0)
            continue
        u, v = (local @ axes[:, 1:]).T / reach
        basis = np.linalg.qr(np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])).Q
        height = local @ axes[:, 0]
        rest = height - basis @ (basis.T @ height)
        deviation = float(np.sqrt(rest @ rest / (len(near) - 6)))
        ratios.append(deviation * np.sqrt(12) / (step * cosine))
    # Patches across an edge deviate by more, so a low quantile is compared.
    return len(ratios) >= 20 and float(np.quantile(ratios, 0.3)) > AGREE
