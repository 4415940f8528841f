"""From points, wherever they came from, to a `Scan`."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Scan
from damageest.errors import InputError
from damageest.meshio import first_of_equal
from damageest.units import canonical


def make_scan(
    points: Floats,
    normals: Floats | None = None,
    unit: str = "mm",
    *,
    paths: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
) -> Scan:
    """A scan from points (N,3), already in ``unit``; says how many were left out, not finite or there already.

    Normals are brought to length 1, and dropped where any is zero or not finite. Raises InputError where no point is
    left.
    """
    name = ", ".join(paths) or "the scan"
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{name}: expected points (N,3), got an array of shape {points.shape}")
    if normals is not None:
        normals = np.asarray(normals, dtype=np.float64)
        if normals.shape != points.shape:
            raise InputError(f"{name}: {len(points)} points, but normals of shape {normals.shape}")
    finite = np.isfinite(points.sum(1))
    if not finite.all():
        notes = (*notes, f"left out {int((~finite).sum())} points whose coordinates are not finite")
        points, normals = points[finite], None if normals is None else normals[finite]
    if not len(points):
        raise InputError(f"{name}: holds no points")
    keep, _ = first_of_equal(points)
    if len(keep) < len(points):
        notes = (*notes, f"left out {len(points) - len(keep)} copies of points that are there already")
        points, normals = points[keep], None if normals is None else normals[keep]
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(length).all() and length.min() > 1e-6:
            normals = normals / length
        else:
            notes, normals = (*notes, "some normals are zero or not finite: none is used"), None
    return Scan(points, normals, canonical(unit), paths, notes=notes)
