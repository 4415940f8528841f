"""The least depth of a loss that the scan can show, by place."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Deviation, Floats, Ints, Scan
from damageest.findings import Sensor
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.noise import find_least_depth

NEAR, FEWEST = 24, 200
"""Intact points whose scatter is the noise of a place, and of the whole scan, below which the places are not told."""

MOST = 500_000
"""Intact points among which these are found."""


def map_least_depth(aligned: Scan, deviation: Deviation, sensor: Sensor, tolerance: float, chosen: Ints) -> Floats:
    """The least depth of a loss that can be seen at each of the points ``chosen`` (K,): `Sensor.least_depth` with the
    noise of the intact skin there."""
    intact = np.flatnonzero(deviation.label == INTACT)
    if len(intact) < FEWEST or not len(chosen):
        return np.full(len(chosen), sensor.least_depth)
    if len(intact) > MOST:
        intact = intact[np.random.default_rng(0).random(len(intact)) < MOST / len(intact)]
    near = find_neighbours(aligned.points[chosen], NEAR, aligned.points[intact])[1]
    noise = deviation.distance[intact][near].std(axis=1)
    return find_least_depth(noise, sensor.correlated, sensor.depth_step, tolerance)
