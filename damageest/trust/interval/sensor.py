"""The errors of the sensor, measured on intact skin: noise, errors that neighbouring points share, steps of
the depth; and the smallest loss that such a scan can show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np

from damageest.artefacts import INTACT, Floats, Scan
from damageest.findings import NoiseLevel, Sensor, VariogramPoint
from damageest.geometry.noise import find_least_depth
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField
from damageest.trust.interval.pose_error import PoseError

EDGE = 4.0
"""Edge of a patch in spacings: about sixteen points on a face."""
FEWEST_POINTS = 8
"""Points of a patch, for its noise to be measured."""
MOST_POINTS = 200_000
"""Intact points that are used."""
INCIDENCES = (0.0, 30.0, 50.0, 65.0, 90.0)
"""Ends in degrees of the ranges of the angle between skin and ray whose noise is told apart."""
DISTANCES = 3
"""Ranges of the distance from the scanner whose noise is told apart."""
FEWEST_OF_LEVEL = 200
"""Points of a range, for its noise to be told."""
NEEDED = 10
"""Points that have to lie deeper than the tolerance beside each other for a site, as stage cluster asks for."""


def measure_levels(field: ScanField) -> tuple[NoiseLevel, ...]:
    """The noise of intact skin by incidence and by distance from the scanner, of points whose scanner position is
    known."""
    aligned = field.aligned
    if aligned.viewpoints is None or aligned.view is None or not aligned.spacing:
        return ()
    index = np.flatnonzero(field.label == INTACT)
    index = index[:: max(1, -(-len(index) // MOST_POINTS))]
    normals, distance = field.find_normals(index), field.distance[index]
    edge = EDGE * aligned.spacing * float(np.sqrt(max(1.0, len(aligned.points) / MOST_POINTS)))
    patches = Patches.on_skin(aligned.points[index], normals, edge)
    group, count = patches.group, patches.count
    square = (distance - patches.mean(distance)[group]) ** 2 * (count / np.maximum(count - 1, 1))[group]
    told = (count >= FEWEST_POINTS)[group] & (aligned.view[index] >= 0)
    if told.sum() < FEWEST_OF_LEVEL:
        return ()
    ray = aligned.viewpoints[aligned.view[index[told]]] - aligned.points[index[told]]
    return _list_levels(ray, normals[told], square[told])


def describe_sensor(
    levels: Sequence[NoiseLevel], aligned: Scan, pose: PoseError, systematic: float,
    depth_step: float, tolerance: float, stray: float, semivariogram: Sequence[VariogramPoint],
) -> Sensor:  # fmt: skip
    """What the intact skin says about the sensor.

    Args:
        pose: its systematic error is that of patches of skin, with the area over which it is alike.
        systematic: the same of smaller cells.
        stray: share of the points that lie off the skin and belong to nothing.
    """
    correlated = max(pose.systematic, systematic)
    return Sensor(
        noise=aligned.noise,
        correlated=correlated,
        alike=float(np.sqrt(pose.patch_area)) if correlated else 0.0,
        depth_step=depth_step,
        stray=stray,
        least_depth=float(find_least_depth(np.array(aligned.noise), correlated, depth_step, tolerance)),
        least_width=float(2 * np.sqrt(measure_shown(aligned, NEEDED) / np.pi)),
        levels=tuple(levels),
        semivariogram=tuple(semivariogram),
    )


def measure_shown(aligned: Scan, count: int) -> float:
    """The area of skin that a number of points of a scan cover."""
    return count * (aligned.spacing / 1.1) ** 2  # as the spacing is measured


def _list_levels(ray: Floats, normals: Floats, square: Floats) -> tuple[NoiseLevel, ...]:
    """The noise of points by incidence and by distance. ``ray`` (N,3): from each to its scanner; ``square`` (N,): of
    its deviation from the mean of its patch."""
    distance = np.linalg.norm(ray, axis=1)
    cosine = np.einsum("ij,ij->i", ray, normals) / np.maximum(distance, 1e-300)
    angle = np.degrees(np.arccos(np.clip(cosine, 0, 1)))
    ends = tuple(np.linspace(distance.min(), distance.max(), DISTANCES + 1).tolist())
    ranges: tuple[tuple[Literal["incidence", "distance"], Floats, tuple[float, ...]], ...]
    ranges = (("incidence", angle, INCIDENCES), ("distance", distance, ends))
    found = []
    for of, value, limits in ranges:
        for low, high in pairwise(limits):
            inside = (value >= low) & (value <= high)
            if inside.sum() >= FEWEST_OF_LEVEL:
                found.append(NoiseLevel(of, low, high, float(np.sqrt(square[inside].mean()))))
    return tuple(found)
