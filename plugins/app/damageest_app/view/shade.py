"""Light and shadow for points, which have no surface that a light could meet: for the eye alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.geometry.neighbourhoods import find_neighbours
from damageest_app.view.scene import to_rgb

COUNT = 10
"""Neighbours that a direction is estimated from."""
LIGHT = np.array([0.45, -0.75, 0.55]) / np.linalg.norm([0.45, -0.75, 0.55])


def shade_points(points: Floats, normals: Floats | None) -> Floats:
    """(N,) how bright each point is, 0 to 1; from its normal, or from the plane of its neighbours where it has none."""
    if len(points) <= COUNT:
        return np.ones(len(points))
    if normals is None:
        _, index = find_neighbours(points, COUNT)
        around = points[index] - points[index].mean(axis=1, keepdims=True)
        spread = np.einsum("nki,nkj->nij", around, around)
        normals = np.linalg.eigh(spread)[1][:, :, 0]
    return np.asarray(0.35 + 0.65 * np.abs(normals @ LIGHT))


def tint(shade: Floats, colour: str) -> NDArray[np.uint8]:
    """(N,3) a colour, as bright as ``shade`` (N,) says."""
    return np.asarray(np.clip(shade[:, None] * np.array(to_rgb(colour)) * 255 * 1.15, 0, 255), np.uint8)
