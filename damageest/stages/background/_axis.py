"""The axis round which a part lies closest."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator

from damageest.artefacts import Floats

Vector = tuple[float, float, float]


def _check_not_zero(value: Vector | str) -> Vector | str:
    if not isinstance(value, str) and not any(value):
        raise ValueError("an axis needs a direction: not all three numbers may be 0")
    return value


Axis = Annotated[Literal["auto", "x", "y", "z"] | Vector, AfterValidator(_check_not_zero)]


def fit_axis(points: Floats, axis: Axis) -> tuple[Floats, Floats, float]:
    """(frame, centre, radius): the rows of ``frame`` (3,3) are two cross directions and the axis, ``centre`` (2,) and
    ``radius`` the smallest circle round the points (N,3) seen along it. ``auto``: of the coordinate and principal axes
    the one whose cylinder round the points is smallest."""
    import trimesh

    if isinstance(axis, str):
        ways = np.eye(3) if axis == "auto" else np.eye(3)["xyz".index(axis)][None]
    else:
        ways = np.array(axis, dtype=np.float64)[None]
    if axis == "auto":
        spread = points - points.mean(axis=0)
        principal = np.linalg.eigh(spread.T @ spread)[1].T
        ways = np.concatenate([ways, principal * np.where(principal.sum(axis=1) < 0, -1, 1)[:, None]])
    best: tuple[float, Floats, Floats, float] | None = None
    for way in ways:
        toward = way / np.linalg.norm(way)
        helper = np.eye(3)[int(np.argmin(np.abs(toward)))]
        u = np.cross(toward, helper)
        u /= np.linalg.norm(u)
        frame = np.stack([u, np.cross(toward, u), toward])
        flat = points @ frame.T
        centre, radius = trimesh.nsphere.minimum_nsphere(flat[:, :2])
        size = float(radius) ** 2 * float(np.ptp(flat[:, 2]))
        # Principal axes of a symmetric part are those of rounding errors: a coordinate axis as good goes first.
        if best is None or size < 0.999 * best[0]:
            best = size, frame, np.asarray(centre, dtype=np.float64), float(radius)
    assert best is not None
    return best[1:]


def take_hull_points(*sets: Floats) -> Floats:
    """The corners of the convex hull of several point sets."""
    from scipy.spatial import ConvexHull

    points = np.concatenate(sets)
    return points[np.sort(ConvexHull(points).vertices)]


def count_segments(radius: float, by: float) -> int:
    """Divisions of a circle whose chords stay within a tenth of ``by``."""
    return int(np.clip(8 * np.ceil(np.pi / np.arccos(max(1 - 0.1 * by / radius, 0.5)) / 8), 16, 512))
