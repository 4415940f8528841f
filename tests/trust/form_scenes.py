"""Scans of a plate that is deformed, scaled or worn, in a nearly right pose."""

from __future__ import annotations

from functools import cache

import numpy as np
from damageest_benchmarks.troubles.parts import make_named_part

from damageest.artefacts import Floats, Part
from damageest.geometry.distance import signed_distance
from damageest.geometry.sampling import sample_by_area
from damageest.trust.model_fit import FittedModel, measure_fit

NOISE, TOLERANCE = 0.05, 0.2


@cache
def get_part(name: str = "plate") -> Part:
    return make_named_part(name)


def draw_skin(name: str = "plate", count: int = 8000) -> tuple[Floats, Floats]:
    """Points on the skin and the normals there."""
    part = get_part(name)
    points, face = sample_by_area(part, count, np.random.default_rng(1))
    return points, part.face_normals[face]


def add_noise(points: Floats) -> Floats:
    return points + np.random.default_rng(2).normal(scale=NOISE, size=points.shape)


def fit(points: Floats, name: str = "plate", shift: float = 0.02) -> FittedModel:
    """The model fit of points on a part, in a pose that is off by a little."""
    points = points + shift
    distance, _ = signed_distance(points, get_part(name))
    found = measure_fit(get_part(name), points, distance, NOISE, TOLERANCE, "mm", None)
    assert found is not None
    return found
