"""Makes scans from files and from arrays of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Scan, Vector
from damageest.errors import InputError
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.units import FARTHEST, canonical_unit, unit_factor
from damageest.io.points import read_points


def make_scan(
    points: Floats,
    normals: Floats | None = None,
    unit: str = "mm",
    *,
    paths: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
    viewpoints: Floats | None = None,
    view: Ints | None = None,
) -> Scan:
    """A scan from points (N,3) in ``unit`` and optional normals (N,3).

    ``viewpoints`` (V,3): scanner positions, in the unit and the frame of the points; ``view`` (N,): the number of each
    point's position, -1 where it is not known. ``viewpoints`` alone: one position (1,3) for all points.

    Points that are not finite or farther than 1e12 from the origin, and duplicates, are removed; the scan's notes give
    their numbers. Normals are scaled to
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
    viewpoints, numbers = _check_views(name, len(points), viewpoints, view)
    scan = Scan(points, normals, canonical_unit(unit), paths, viewpoints=viewpoints, view=numbers)
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if not finite.all():
        notes = (*notes, f"removed {int((~finite).sum())} points with coordinates that are not finite")
        scan = scan.take(finite)
    near = np.asarray((np.abs(scan.points) <= FARTHEST).all(axis=1))
    if not near.all():
        notes = (*notes, f"removed {int((~near).sum())} points with coordinates above {FARTHEST:g}, which no scan has")
        scan = scan.take(near)
    if not len(scan.points):
        raise InputError(f"{name}: has no points" + (f" with valid coordinates; {notes[-1]}" if len(points) else ""))
    keep, _ = find_duplicates(scan.points)
    if len(keep) < len(scan.points):
        notes = (*notes, f"removed {len(scan.points) - len(keep)} duplicate points")
        scan = scan.take(keep)
    normals = scan.normals
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(length).all() and length.min() > 1e-6:
            normals = normals / length
        else:
            notes, normals = (*notes, "some normals are zero or not finite; no normals are used"), None
    return replace(scan, normals=normals, notes=notes)


def _check_views(
    name: str, count: int, viewpoints: Floats | None, view: Ints | None
) -> tuple[Floats | None, NDArray[np.int32] | None]:
    """Scanner positions and their numbers in the types of a scan. Raises InputError where they do not fit."""
    if viewpoints is None:
        if view is not None:
            raise InputError(f"{name}: view needs viewpoints")
        return None, None
    viewpoints = np.asarray(viewpoints, dtype=np.float64)
    if viewpoints.ndim != 2 or viewpoints.shape[1] != 3 or not (np.abs(viewpoints) <= FARTHEST).all():
        raise InputError(f"{name}: viewpoints need the shape (V,3), and coordinates up to {FARTHEST:g}")
    if view is None:
        if len(viewpoints) != 1:
            raise InputError(f"{name}: {len(viewpoints)} viewpoints need a view: the number of each point's viewpoint")
        view = np.zeros(count, np.int64)
    view = np.asarray(view)
    if view.shape != (count,) or (count and not -1 <= view.min() <= view.max() < len(viewpoints)):
        raise InputError(f"{name}: view needs the shape ({count},) and numbers from -1 to {len(viewpoints) - 1}")
    return viewpoints, view.astype(np.int32)


def read_scan(
    paths: Sequence[Path],
    unit: str,
    source: str | None = None,
    columns: str | None = None,
    viewpoints: Sequence[Vector | None] | None = None,
) -> Scan:
    """The points of one file, or of several files in the same frame, in ``unit``.

    ``source``: unit of the lengths in the files; None: the unit that each file states (E57, PTX: m), else ``unit``.
    ``columns``: names of the columns of a text file. ``viewpoints``: for each file where its scanner stood, in the unit
    and the frame of the file; None: where the file itself says, if it does. Raises InputError if a file cannot be read
    or has no points.
    """
    if not paths:
        raise InputError("scan: no file is given")
    clouds = [read_points(path, columns) for path in paths]
    notes: list[str] = []
    scaled = []
    positions: list[Floats] = []
    views: list[Ints] = []
    for cloud, path, given_viewpoint in zip(clouds, paths, viewpoints or [None] * len(paths), strict=True):
        notes.extend(f"{path.name}: {note}" if len(paths) > 1 else note for note in cloud.notes)
        own = canonical_unit(source or cloud.unit or unit)
        points = np.asarray(cloud.points, dtype=np.float64)
        factor = unit_factor(own, unit)
        at, view = cloud.viewpoints, cloud.view
        if given_viewpoint is not None:
            at, view = np.array([given_viewpoint], dtype=np.float64), np.zeros(len(points), np.int64)
        if at is None or view is None:
            views.append(np.full(len(points), -1))
        else:
            views.append(np.where(view >= 0, view + sum(map(len, positions)), -1))
            positions.append(at * factor)
        if own != canonical_unit(unit):
            notes.append(f"{path.name}: converted from {own} to {canonical_unit(unit)}")
            points = points * factor
        scaled.append(points)
    given = [cloud.normals for cloud in clouds if cloud.normals is not None]
    normals = np.concatenate(given) if len(given) == len(clouds) else None
    if given and normals is None:
        notes.append("only some of the files have normals; no normals are used")
    whole = scaled[0] if len(scaled) == 1 else np.concatenate(scaled)
    return make_scan(
        whole,
        normals,
        unit,
        paths=tuple(map(str, paths)),
        notes=tuple(notes),
        viewpoints=np.concatenate(positions) if positions else None,
        view=np.concatenate(views) if positions else None,
    )
