"""Makes scans from files and from arrays of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Bytes, Floats, Ints, Reason, Scan, Singles, Vector
from damageest.errors import InputError
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.stacks import find_stacks
from damageest.geometry.units import FARTHEST, canonical_unit, unit_factor
from damageest.io.file_memory import require_memory_for
from damageest.io.points import PointFile, read_points
from damageest.io.scan_notes import ConfidenceCount, UnitNotes, describe_coarse

GREY = 128
"""Colour of the points of a file without colours, beside files with."""


def make_scan(
    points: Floats,
    normals: Floats | None = None,
    unit: str = "mm",
    *,
    paths: tuple[str, ...] = (),
    notes: tuple[str, ...] = (),
    viewpoints: Floats | None = None,
    view: Ints | NDArray[np.int32] | None = None,
    colours: Bytes | None = None,
    confidence: Singles | None = None,
    cloud: Ints | None = None,
) -> Scan:
    """A scan from points (N,3) in ``unit`` and optional normals (N,3).

    ``viewpoints`` (V,3): scanner positions, in the unit and the frame of the points; ``view`` (N,): the number of each
    point's position, -1 where it is not known. ``viewpoints`` alone: one position (1,3) for all points. ``colours``
    (N,3) and ``confidence`` (N,) are kept as they are. ``cloud`` (N,): the number of the cloud of each point, for
    example of its file; -1 where it is not known.

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
    if cloud is not None and np.shape(cloud) != (len(points),):
        raise InputError(f"{name}: cloud needs the shape ({len(points)},), but has the shape {np.shape(cloud)}")
    own = None if cloud is None else np.asarray(cloud, np.int32)
    scan = Scan(
        points, normals, canonical_unit(unit), paths, viewpoints=viewpoints, view=numbers, colours=colours,
        confidence=confidence, cloud=own,
    )  # fmt: skip
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if not finite.all():
        notes = (*notes, f"removed {int((~finite).sum())} points with coordinates that are not finite")
        scan = scan.take(finite)
    near = np.asarray(((scan.points <= FARTHEST) & (scan.points >= -FARTHEST)).all(axis=1))
    if not near.all():
        notes = (*notes, f"removed {int((~near).sum())} points with coordinates above {FARTHEST:g}, which no scan has")
        scan = scan.take(near)
    if not len(scan.points):
        raise InputError(f"{name}: has no points" + (f" with valid coordinates; {notes[-1]}" if len(points) else ""))
    notes = (*notes, *_describe_lost_coordinate(scan.points))
    keep, _ = find_duplicates(scan.points)
    if len(keep) < len(scan.points):
        notes = (*notes, f"removed {len(scan.points) - len(keep)} duplicate points")
        scan = scan.take(keep)
    scan, made = average_stacks(scan)
    notes = (*notes, *made)
    normals = scan.normals
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        wrong = int((~(length > 1e-6) | ~np.isfinite(length)).sum())
        if not wrong:
            normals = normals / length
        else:
            which = "all" if wrong == len(normals) else f"{wrong:,} of {len(normals):,}"
            notes, normals = (*notes, f"{which} normals are zero or not finite; no normals are used"), None
    return replace(scan, normals=normals, notes=notes)


def _describe_lost_coordinate(points: Floats) -> tuple[str, ...]:
    """A note where a coordinate is the same at all points, as where the numbers of a file overflowed."""
    low, high = points.min(axis=0), points.max(axis=0)
    same = np.flatnonzero((low == high) & (high - low < np.max(high - low)))
    return tuple(
        f"{'xyz'[k]} is {low[k]:.10g} at all {len(points):,} points: the file has lost this coordinate, or a plane was "
        "drawn and not scanned" for k in same
    )  # fmt: skip


def average_stacks(scan: Scan) -> tuple[Scan, tuple[str, ...]]:
    """The scan with the points of each stack (see `damageest.geometry.stacks`) averaged, and a note where it has some.
    What a point has besides its place is that of the first of its stack."""
    found = find_stacks(scan.points)
    if found is None:
        return scan, ()
    label, reach = found
    count = np.bincount(label)
    means = np.stack([np.bincount(label, scan.points[:, axis]) for axis in range(3)], axis=1) / count[:, None]
    averaged = replace(scan.take(np.unique(label, return_index=True)[1]), points=means)
    note = (
        f"{len(scan.points):,} points lie in {len(count):,} stacks, up to {count.max()} points within {reach:.2g} "
        f"{scan.unit} of each other, as from repeated exposures: each stack counts as one point, its mean"
    )
    return averaged, (note,)


def _check_views(
    name: str, count: int, viewpoints: Floats | None, view: Ints | NDArray[np.int32] | None
) -> tuple[Floats | None, NDArray[np.int32] | None]:
    """Scanner positions and their numbers in the types of a scan. Raises InputError where they do not fit."""
    if viewpoints is None:
        if view is not None:
            raise InputError(f"{name}: view needs viewpoints")
        return None, None
    viewpoints = np.asarray(viewpoints, dtype=np.float64)
    if viewpoints.ndim != 2 or viewpoints.shape[1] != 3 or not (np.abs(viewpoints) <= FARTHEST).all():
        raise InputError(f"{name}: viewpoints need the shape (V,3), and coordinates up to {FARTHEST:g}")
    if view is None and len(viewpoints) != 1:
        raise InputError(f"{name}: {len(viewpoints)} viewpoints need a view: the number of each point's viewpoint")
    numbers: NDArray[Any] = np.zeros(count, np.int32) if view is None else np.asarray(view)
    if numbers.shape != (count,) or (count and not -1 <= numbers.min() <= numbers.max() < len(viewpoints)):
        raise InputError(f"{name}: view needs the shape ({count},) and numbers from -1 to {len(viewpoints) - 1}")
    return viewpoints, numbers.astype(np.int32)


def read_scan(
    paths: Sequence[Path],
    unit: str,
    source: str | None = None,
    columns: str | None = None,
    viewpoints: Sequence[Vector | None] | None = None,
    min_confidence: float | None = None,
) -> Scan:
    """The points of one file, or of several files in the same frame, in ``unit``.

    ``source``: unit of the lengths in the files; None: the unit that each file states, by its header or the standard of
    its format, else ``unit``. ``columns``: names of the columns of a text file. ``viewpoints``: for each file where its
    scanner stood, in the unit and the frame of the file; None: where the file itself says, if it does.
    ``min_confidence``: points of a lower confidence are left out. Raises InputError if a file cannot be read or has no
    points, and where there is a ``min_confidence`` and no confidence.
    """
    if not paths:
        raise InputError("scan: no file is given")
    require_memory_for(paths)
    notes: list[str] = []
    units, confidence = UnitNotes(source, unit), ConfidenceCount(min_confidence)
    clouds: list[PointFile] = []
    positions: list[Floats] = []
    views: list[Ints] = []
    meant: list[str] = []
    doubts: list[Reason] = []
    for path, given in zip(paths, viewpoints or [None] * len(paths), strict=True):
        cloud = read_points(path, columns)
        notes.extend(f"{path.name}: {note}" if len(paths) > 1 else note for note in cloud.notes)
        if coarse := describe_coarse(cloud.points, path):
            doubts.append(coarse)
        if cloud.columns:
            meant.append(f"{path.name}: {cloud.columns}")
        factor = unit_factor(units.settle(path, cloud.unit, cloud.unit_said), unit)
        at, view = cloud.viewpoints, cloud.view
        if given is not None:
            at, view = np.array([given], dtype=np.float64), np.zeros(len(cloud.points), np.int64)
        if at is None or view is None:
            view = np.full(len(cloud.points), -1)
        else:
            view = np.where(view >= 0, view + sum(map(len, positions)), -1)
            positions.append(at * factor)
        cloud = replace(cloud, points=np.asarray(cloud.points, dtype=np.float64))
        if factor != 1:
            cloud = replace(cloud, points=cloud.points * factor)
        keep = confidence.choose(cloud.confidence, len(cloud.points))
        clouds.append(cloud if keep is None else cloud.take(keep))
        views.append(view if keep is None else view[keep])
    confidence.require(paths)
    given_normals = [cloud.normals for cloud in clouds if cloud.normals is not None]
    normals = _join(given_normals) if len(given_normals) == len(clouds) else None
    if given_normals and normals is None:
        notes.append("only some of the files have normals; no normals are used")
    colours, single = join_attributes(clouds)
    if colours is not None and (grey := sum(cloud.colours is None for cloud in clouds)):
        notes.append(f"{grey} of {len(clouds)} files have no colours; their points are grey")
    points = _join([cloud.points for cloud in clouds])
    del clouds
    scan = make_scan(
        points,
        normals,
        unit,
        paths=tuple(map(str, paths)),
        notes=(*notes, *units.notes(), *confidence.notes()),
        viewpoints=np.concatenate(positions) if positions else None,
        view=np.concatenate(views) if positions else None,
        colours=colours,
        confidence=single,
        cloud=number_clouds(views),
    )
    return replace(scan, warnings=(*units.warnings(), *confidence.warnings(), *doubts), columns=tuple(meant))


def join_attributes(pieces: Sequence[PointFile | Scan]) -> tuple[Bytes | None, Singles | None]:
    """Colours (N,3) and confidence (N,) of all points, one piece after the other; None where no piece has them. Points
    of a piece without are grey, and their confidence is no number."""
    sizes = [len(piece.points) for piece in pieces]
    return (
        _join_some([piece.colours for piece in pieces], [(size, 3) for size in sizes], GREY),
        _join_some([piece.confidence for piece in pieces], [(size,) for size in sizes], np.nan),
    )


def _join_some(arrays: Sequence[NDArray[Any] | None], shapes: Sequence[tuple[int, ...]], lacking: float) -> Any:
    """The arrays one after the other, with ``lacking`` in place of those that are None; None where all are."""
    known = next((array for array in arrays if array is not None), None)
    if known is None:
        return None
    pairs = zip(arrays, shapes, strict=True)
    return _join([np.full(shape, lacking, known.dtype) if array is None else array for array, shape in pairs])


def _join(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def number_clouds(views: Sequence[Ints]) -> Ints | None:
    """The number (N,) of the cloud of each point of several files one after the other, from the view of each of a
    file's points: each view of each file is a cloud. None for a single file, whose views say it all."""
    if len(views) < 2:
        return None
    first, numbers = 0, []
    for view in views:
        known, own = np.unique(view, return_inverse=True)
        numbers.append(first + own)
        first += len(known)
    return np.concatenate(numbers)
