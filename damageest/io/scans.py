"""Makes scans from files and from arrays of points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats, Scan
from damageest.errors import InputError
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.units import canonical_unit, unit_factor
from damageest.io.points import read_points


def make_scan(
    points: Floats,
    normals: Floats | None = None,
    unit: str = "mm",
    *,
    paths: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
) -> Scan:
    """A scan from points (N,3) in ``unit`` and optional normals (N,3).

    Points that are not finite and duplicates are removed; the scan's notes give their numbers. Normals are scaled to
    length 1. If one of them is zero or not finite, no normals are used. Raises InputError if no point remains.
    """
    name = ", ".join(paths) or "the scan"
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{name}: points need the shape (N,3), but the array has the shape {points.shape}")
    if normals is not None:
        normals = np.asarray(normals, dtype=np.float64)
        if normals.shape != points.shape:
            raise InputError(
                f"{name}: normals need the shape of the points, {points.shape}, but have the shape {normals.shape}"
            )
    finite = np.isfinite(points.sum(1))
    if not finite.all():
        notes = (*notes, f"removed {int((~finite).sum())} points with coordinates that are not finite")
        points, normals = points[finite], None if normals is None else normals[finite]
    if not len(points):
        raise InputError(f"{name}: has no points")
    keep, _ = find_duplicates(points)
    if len(keep) < len(points):
        notes = (*notes, f"removed {len(points) - len(keep)} duplicate points")
        points, normals = points[keep], None if normals is None else normals[keep]
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(length).all() and length.min() > 1e-6:
            normals = normals / length
        else:
            notes, normals = (*notes, "some normals are zero or not finite; no normals are used"), None
    return Scan(points, normals, canonical_unit(unit), paths, notes=notes)


def read_scan(paths: Sequence[Path], unit: str, source: str | None = None, columns: str | None = None) -> Scan:
    """The points of one file, or of several files in the same frame, in ``unit``.

    ``source``: unit of the lengths in the files; None: the unit that each file states (E57: m), else ``unit``.
    ``columns``: names of the columns of a text file. Raises InputError if a file cannot be read or has no points.
    """
    if not paths:
        raise InputError("scan: no file is given")
    clouds = [read_points(path, columns) for path in paths]
    notes: list[str] = []
    scaled = []
    for cloud, path in zip(clouds, paths, strict=True):
        notes.extend(f"{path.name}: {note}" if len(paths) > 1 else note for note in cloud.notes)
        own = canonical_unit(source or cloud.unit or unit)
        points = np.asarray(cloud.points, dtype=np.float64)
        if own != canonical_unit(unit):
            notes.append(f"{path.name}: converted from {own} to {canonical_unit(unit)}")
            points = points * unit_factor(own, unit)
        scaled.append(points)
    given = [cloud.normals for cloud in clouds if cloud.normals is not None]
    normals = np.concatenate(given) if len(given) == len(clouds) else None
    if given and normals is None:
        notes.append("only some of the files have normals; no normals are used")
    whole = scaled[0] if len(scaled) == 1 else np.concatenate(scaled)
    return make_scan(whole, normals, unit, paths=tuple(map(str, paths)), notes=tuple(notes))
