"""How alike errors of neighbouring points are: the semivariogram of the intact skin's distances from the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Floats
from damageest.findings import VariogramPoint
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours
from damageest.geometry.scan_field import ScanField

ASKED = 1200
"""Intact points whose pairs are compared, spread over the scan at random."""
NEIGHBOURS = 12
"""Nearest points that each of them is compared with besides, for the shortest distances."""
AROUND = 6.0
"""Distance in spacings within which these lie: there are a hundred points, where the scan has no gap."""
FARTHEST = 0.3
"""Largest distance of a pair, in diagonals of the part."""
STEPS = 10
"""Ranges of the distance, each by the same factor wider than the one before."""
FACING = 0.8
"""Cosine between the normals of a pair, at least: a wall has two sides, whose errors are not compared."""
FEWEST = 100
"""Pairs of a range, for its variance to be told."""


def measure_semivariogram(field: ScanField) -> tuple[VariogramPoint, ...]:
    """Half the mean square by which the distances from the part differ between intact points, by the distance between
    them (Matheron's estimator, Principles of geostatistics, Econ. Geol. 58, 1963).

    It begins at the square of the noise, rises to the variance of all errors, and is level from the distance on over
    which errors are shared. Empty for a scan of few intact points.
    """
    index, spacing, farthest = (
        np.flatnonzero(field.label == INTACT),
        field.aligned.spacing,
        FARTHEST * field.part.diagonal,
    )
    if len(index) < FEWEST or not spacing:
        return ()
    some = np.sort(np.random.default_rng(0).permutation(len(index))[:ASKED])
    points, distance = field.points[index], field.distance[index]
    first, second = np.triu_indices(len(some), 1)
    around = find_nearby(points, points[some], AROUND * spacing)
    near = around[find_neighbours(points[some], min(NEIGHBOURS, len(around)), points[around])[1]]
    first = np.concatenate([some[first], np.repeat(some, near.shape[1])])
    second = np.concatenate([some[second], near.ravel()])
    apart: Floats = np.linalg.norm(points[first] - points[second], axis=1)
    normals = [field.find_normals(index[one]) for one in (first, second)]
    alike = np.einsum("ij,ij->i", *normals) > FACING
    used = alike & (apart > 0) & (apart < farthest)
    edges = np.geomspace(0.5 * spacing, max(farthest, spacing), STEPS + 1)
    step = np.clip(np.searchsorted(edges, apart[used]) - 1, 0, STEPS - 1)
    square = 0.5 * (distance[first[used]] - distance[second[used]]) ** 2
    count = np.bincount(step, minlength=STEPS)
    apart, square = (np.bincount(step, value, STEPS) / np.maximum(count, 1) for value in (apart[used], square))
    return tuple(
        VariogramPoint(float(far), float(half))
        for far, half, pairs in zip(apart, square, count, strict=True)
        if pairs >= FEWEST
    )
