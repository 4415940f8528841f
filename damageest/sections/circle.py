"""Circles through outlines: of shafts, rings and bores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise

ON_CIRCLE = 0.6
"""Share of an outline that has to lie on one circle for it to be a round."""
ROUNDNESS = 1e-3
"""Distance from a circle, in radii, up to which a part of the outline as designed lies on it."""


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle. ``covariance`` (3,3): of centre and radius, for points of standard deviation 1."""

    centre: Floats
    radius: float
    covariance: Floats

    def measure(self, places: Floats) -> Floats:
        """Distances (N,) of places (N,2) outside the circle."""
        return np.asarray(np.linalg.norm(places - self.centre, axis=1) - self.radius)


def fit_circle(places: Floats, scale: float | None = None) -> Circle | None:
    """The circle through places (N,2) of least squares; those farther than some ``scale`` count less where that is
    given. None where they do not fix one."""
    if len(places) < 6:
        return None
    from scipy.optimize import least_squares

    middle = places.mean(axis=0)
    at = places - middle
    size = float(np.sqrt((at**2).sum(axis=1).mean()))
    if not size > 0:
        return None
    rows = np.column_stack([2 * at / size, np.ones(len(at))])
    found, _, rank, singular = np.linalg.lstsq(rows, (at**2).sum(axis=1) / size**2, rcond=None)
    if rank < 3 or singular[-1] < 1e-6 * singular[0]:
        return None
    centre = found[:2]
    start = np.array([*centre, np.sqrt(max(found[2] + centre @ centre, 1e-12))])
    scaled = at / size

    def off(x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(scaled - x[:2], axis=1) - x[2])

    loss: Literal["linear", "cauchy"] = "linear" if scale is None else "cauchy"
    fit = least_squares(off, start, loss=loss, f_scale=1.0 if scale is None else max(scale / size, 1e-12))
    weights = np.ones(len(at)) if scale is None else 1 / (1 + (off(fit.x) * size / max(scale, 1e-12)) ** 2)
    away = scaled - fit.x[:2]
    slopes = np.column_stack([-normalise(away), -np.ones(len(at))])
    try:
        covariance = np.asarray(np.linalg.inv((slopes * weights[:, None]).T @ slopes), np.float64)
    except np.linalg.LinAlgError:
        return None
    return Circle(middle + size * fit.x[:2], float(size * fit.x[2]), covariance)


def find_round(corners: Floats, deviation: float) -> Circle | None:
    """The circle that most of an outline as designed lies on, by its corners (K,2); None where there is none.

    ``deviation``: by how much corners may be off besides.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(edges, axis=1)
    weight = (size + np.roll(size, 1)) / 2 / size.sum()
    chosen = np.ones(len(corners), bool)
    for _ in range(8):
        scale = None if chosen.all() else 1e-3 * float(np.ptp(corners, axis=0).max())
        circle = fit_circle(corners[chosen], scale)
        if circle is None:
            return None
        limit = ROUNDNESS * circle.radius + deviation
        off = np.abs(circle.measure(corners))
        if weight[off <= limit].sum() >= ON_CIRCLE:
            # an ellipse of two near axes has no such part; a regular polygon of few corners has long edges
            sagitta = circle.radius - np.sqrt(np.maximum(circle.radius**2 - (size / 2) ** 2, 0))
            on = (off <= limit) & (np.roll(off, -1) <= limit) & (sagitta < 0.02 * circle.radius)
            return circle if size[on].sum() >= ON_CIRCLE * size.sum() else None
        median = float(np.median(off[chosen]))
        chosen = off <= max(limit, 1.5 * median)
    return None
