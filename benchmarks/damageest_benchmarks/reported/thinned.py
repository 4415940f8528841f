"""Scans that were thinned, filtered or rounded before they were saved."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.reported.bench import Bench, read_again, take


def _average(points: Floats, size: float) -> Floats:
    """The mean of the points in each cube of this size."""
    cube = np.unique(np.floor(points / size).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    total = np.stack([np.bincount(cube, points[:, k]) for k in range(3)], axis=1)
    return np.asarray(total / np.bincount(cube)[:, None])


def middles_of_cubes() -> Draw:
    """Each point is moved to the middle of its cube of three tolerances."""
    bench = take("block", 1)
    size = 3 * bench.tolerance
    points = bench.scan(120_000)[0]
    return bench.finish(points, after=lambda at: np.unique((np.floor(at / size) + 0.5) * size, axis=0))


def means_of_cubes() -> Draw:
    """The mean of the points in each cube of 1.2 % of the diagonal: edges become round."""
    bench = take("lever", 2, (1, 0, 1), 0.05)
    size = 0.012 * bench.part.diagonal
    return bench.finish(bench.scan(120_000)[0], after=lambda at: _average(at, size))


def rounded_coordinates() -> Draw:
    """Coordinates are whole multiples of 1.5 tolerances, and many points become one."""
    bench = take("tube", 3, (1, 0, 1))
    step = 1.5 * bench.tolerance
    return bench.finish(bench.scan(60_000)[0], after=lambda at: np.round(at / step) * step)


def one_coordinate_in_steps() -> Draw:
    """One coordinate has few values, as large ones in single precision have."""
    bench = take("coupling", 4, (1, 0, -1))
    step = np.array([1e-9, 1.2 * bench.tolerance, 1e-9])
    return bench.finish(bench.scan(30_000)[0], after=lambda at: np.round(at / step) * step)


def saturated_coordinate() -> Draw:
    """A file whose integers overflow: one coordinate of all points has the same value."""
    bench = take("block", 5)

    def clip(at: Floats) -> Floats:
        at = at.copy()
        at[:, 1] = -2147483.648
        return at

    return read_again(bench.finish(bench.scan()[0], after=clip))


def _find_bends(bench: Bench, points: Floats, normals: Floats) -> Flags:
    """Points where the surface bends or has an edge."""
    from scipy.spatial import cKDTree

    near = cKDTree(points).query(points, 12)[1]
    return np.asarray(np.linalg.norm(normals[near].mean(axis=1), axis=1) < 0.995)


def flats_without_vertices() -> Draw:
    """Simplified by error: edges and curves keep their vertices, flat faces one in sixty."""
    bench = take("block", 6)
    points, normals = bench.scan(60_000)
    keep = _find_bends(bench, points, normals) | (bench.rng.random(len(points)) < 1 / 60)
    return bench.finish(points[keep])


def strict_outlier_filter() -> Draw:
    """What has more space around it than half a standard deviation over the mean was taken away as an outlier."""
    from scipy.spatial import cKDTree

    bench = take("lever", 7, (1, 0, 1), 0.05)
    points = bench.scan(60_000)[0]
    side = points @ np.array([0.6, 0.5, 0.62]) / bench.part.diagonal
    points = points[bench.rng.random(len(points)) < np.clip(0.6 + 1.2 * side, 0.08, 1)]
    gap = np.asarray(cKDTree(points).query(points, 21)[0])[:, 1:].mean(axis=1)
    return bench.finish(points[gap < gap.mean() + 0.5 * gap.std()])


def zeros_for_no_answer() -> Draw:
    """Pixels without an answer lie in the scanner's place."""
    bench = take("ribbed_plate", 8, (1, 1, 0), 0.06)
    points = bench.scan()[0]

    def add(at: Floats) -> Floats:
        return np.concatenate([at, np.zeros((4000, 3))])

    return bench.finish(points, after=add)
