"""The axis of the smallest cylinder round a part."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator

from damageest.artefacts import Floats, Vector


def _check_not_zero(value: Vector | str) -> Vector | str:
    if not isinstance(value, str) and not any(value):
        raise ValueError("an axis needs a direction; not all three numbers may be 0")
    return value


AxisOption = Annotated[Literal["auto", "x", "y", "z"] | Vector, AfterValidator(_check_not_zero)]


def fit_axis(points: Floats, axis: AxisOption) -> tuple[Floats, Floats, float]:
    """The smallest cylinder round points (N,3) along an axis, as (frame, centre, radius).

    The rows of ``frame`` (3,3) are two directions across the axis, and the axis. ``centre`` (2,), in these two
    directions, and ``radius`` are those of the smallest circle round the points seen along the axis. ``auto``: the one
    of the coordinate axes and principal axes with the smallest cylinder.
    """
    import trimesh

    if isinstance(axis, str):
        directions = np.eye(3) if axis == "auto" else np.eye(3)["xyz".index(axis)][None]
    else:
        directions = np.array(axis, dtype=np.float64)[None]
    if axis == "auto":
        spread = points - points.mean(axis=0)
        principal = np.linalg.eigh(spread.T @ spread)[1].T
        directions = np.concatenate([directions, principal * np.where(principal.sum(axis=1) < 0, -1, 1)[:, None]])
    best: tuple[float, Floats, Floats, float] | None = None
    for direction in directions:
        toward = direction / np.linalg.norm(direction)
        helper = np.eye(3)[int(np.argmin(np.abs(toward)))]
        u = np.cross(toward, helper)
        u /= np.linalg.norm(u)
        frame = np.stack([u, np.cross(toward, u), toward])
        flat = points @ frame.T
        centre, radius = trimesh.nsphere.minimum_nsphere(flat[:, :2])
        size = float(radius) ** 2 * float(np.ptp(flat[:, 2]))
        # On a symmetric part rounding decides the principal axes: prefer a coordinate axis that is about as good.
        if best is None or size < 0.999 * best[0]:
            best = size, frame, np.asarray(centre, dtype=np.float64), float(radius)
    assert best is not None
    return best[1:]


def take_hull_points(*sets: Floats) -> Floats:
    """The corners (K,3) of the convex hull of several point sets (N,3)."""
    from scipy.spatial import ConvexHull

    points = np.concatenate(sets)
    return points[np.sort(ConvexHull(points).vertices)]


def count_segments(radius: float, gap: float) -> int:
    """How many segments a circle needs so that its chords are off by at most a tenth of ``gap``."""
    return int(np.clip(8 * np.ceil(np.pi / np.arccos(max(1 - 0.1 * gap / radius, 0.5)) / 8), 16, 512))
