"""Scans of which the reader gives only some points: those near damage are added from the files.

The pose comes from the points that were kept. Then all points are read again, piece by piece: once to find where metal
is missing, once to take what lies there. So memory follows the area of the damage, and not the number of points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Scan
from damageest.errors import InputError
from damageest.geometry.crops import Crop
from damageest.geometry.distance import signed_distance
from damageest.geometry.distance_by_cells import signed_distance_by_cells
from damageest.geometry.duplicates import list_distinct
from damageest.geometry.transforms import move_points
from damageest.io.large_scans import JoinedViews
from damageest.io.scans import join_attributes, make_scan
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.placing.form import divide_scan
from damageest.pipeline.state import JobState
from damageest.pipeline.steps import step
from damageest.stages.scan import ReadScan

DEEP = 0.7
"""Depth below the skin, in tolerances, from which a point marks the space around it."""
EDGE = 4.0
"""Edge, in tolerances, of the cubes of space that are marked; the cubes beside them count too."""
MOST_CUBES = 1 << 20
"""Cubes along an axis at most, so that their numbers fit into 64 bits."""


def check_crops(crops: Iterable[Crop]) -> None:
    """Raises InputError for a crop that needs all points at once."""
    if any(crop.needs_all for crop in crops):
        raise InputError(
            "scan: crop  keep: largest piece  needs all points at once, but the scan is read in pieces; give  "
            "most_points: 0  where the memory suffices, or crop by a box, a cylinder or a plane"
        )


TAKEN = ("reader", "scan", "pose", "part", "tolerance", "unit", "thermal_scale", "scan_centre")


@step(gives="scan", reads=TAKEN)
def add_points_near_damage(engine: Engine, state: JobState) -> Scan:
    """Adds all points near damage where the reader gave some points of a scan that has more. The spacing is then that
    near damage. What is found is kept in the cache, as the output of a stage."""
    reader = state.reader
    if not state.scan.total or reader is None:
        return state.scan
    key = digest("add_points_near_damage", [state.key(name) for name in TAKEN])
    found: Scan = engine.remember("add_points_near_damage", key, lambda: _add_points(engine, state, reader))[1]
    return found


def _add_points(engine: Engine, state: JobState, reader: ReadScan) -> Scan:
    scan, scale = state.scan, state.thermal_scale
    place = _Place(state.part, state.pose.T_part_scan, state.tolerance)
    most = max(len(scan.points) // 2, 1_000_000)

    def read() -> Iterator[Scan]:
        pieces = _crop(_read(engine, reader, state.unit), reader.crop)
        return pieces if scale == 1 else (divide_scan(piece, scale, state.scan_centre) for piece in pieces)

    return _gather(read, place, most, scan)


class _Place:
    """Where the part is in the scan, and which cubes of space are asked for."""

    def __init__(self, part: Part, pose: Floats, tolerance: float) -> None:
        self._part, self._pose, self._tolerance = part, pose, tolerance
        self._edge = max(EDGE * tolerance, part.diagonal / (MOST_CUBES / 4))
        self._low = part.bounds[0] - 3 * self._edge
        self._shape = np.ceil((part.bounds[1] - self._low) / self._edge).astype(np.int64) + 3

    def find_deep(self, points: Floats) -> Ints:
        """The numbers of the cubes in which points (N,3) of the scan lie deep below the skin, ascending."""
        at, number = self._number(points)
        at, number = at[number >= 0], number[number >= 0]
        if not len(at):
            return np.empty(0, np.int64)
        near = 0.5 * self._tolerance
        distance, _ = signed_distance_by_cells(at, self._part, near, lambda some: signed_distance(some, self._part))
        return list_distinct(number[distance < -DEEP * self._tolerance])

    def widen(self, cubes: Ints) -> Ints:
        """The cubes and those beside them."""
        step = np.array([self._shape[1] * self._shape[2], self._shape[2], 1])
        around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ step
        return list_distinct(cubes[:, None] + around)

    def is_in(self, points: Floats, cubes: Ints) -> Flags:
        """Whether each of the points (N,3) of the scan is in one of the cubes, whose numbers are sorted."""
        number = self._number(points)[1]
        found = np.minimum(np.searchsorted(cubes, number), len(cubes) - 1)
        return np.asarray(cubes[found] == number)

    def _number(self, points: Floats) -> tuple[Floats, Ints]:
        """The points in the part's frame, and the number (N,) of each one's cube, -1 away from the part."""
        at = move_points(points, self._pose)
        cell = np.floor((at - self._low) / self._edge)
        inside = ((cell >= 1) & (cell < self._shape - 1)).all(axis=1)
        x, y, z = np.where(inside[:, None], cell, 0).astype(np.int64).T
        return at, np.where(inside, (x * self._shape[1] + y) * self._shape[2] + z, -1)


def _read(engine: Engine, stage: ReadScan, unit: str) -> Iterator[Scan]:
    """The pieces that the job's reader gives, one after the other."""
    pieces = engine.ask(ReadScan, lambda: iter(stage.read_pieces(unit)), Iterator)
    end = Scan(np.empty((0, 3)))
    while (piece := engine.ask(ReadScan, lambda: next(pieces, end), Scan)) is not end:
        yield piece


def _crop(pieces: Iterator[Scan], crops: tuple[Crop, ...]) -> Iterator[Scan]:
    for piece in pieces:
        for crop in crops:
            inside = crop.contains(piece.points)
            piece = piece.take(inside if crop.keep else ~inside)
        yield piece


def _gather(read: Callable[[], Iterator[Scan]], place: _Place, most: int, scan: Scan) -> Scan:
    """The scan with all points near damage; where these are more than ``most``, with so many of them."""
    found = [place.find_deep(piece.points) for piece in read()]
    deep = list_distinct(np.concatenate(found)) if found else np.empty(0, np.int64)
    told = f"the files have {scan.total} points; an even selection of {len(scan.points)} is used"
    if not len(deep):
        return replace(scan, notes=(*scan.notes, f"{told}: no others lie deeper than {DEEP:g} tolerances"))
    cubes, rng, joined = place.widen(deep), np.random.default_rng(0), JoinedViews()
    count = 0
    for piece in read():
        chosen = place.is_in(piece.points, cubes)
        count += int(chosen.sum())
        joined.add(replace(piece, normals=None), chosen, rng)  # only the alignment takes normals
        joined.halve_to(most)
    added = joined.take()
    points, view = added.points, added.view
    near = f"all {count}" if count <= most else f"{len(points)} of {count}"
    note = f"{told}, and {near} near damage"
    if scan.view is not None:
        view = np.concatenate([scan.view, np.full(len(points), -1) if view is None else view])
    colours, confidence = join_attributes([scan, added])
    more = make_scan(  # which removes the points that were among the thinned ones already
        np.concatenate([scan.points, points]), None, scan.unit, paths=scan.paths, viewpoints=scan.viewpoints,
        view=None if scan.view is None else view,
        colours=colours, confidence=confidence,
    )  # fmt: skip
    spacing = scan.spacing * float(np.sqrt(min(most / count, 1.0) * len(scan.points) / scan.total))
    return replace(
        more, noise=scan.noise, spacing=spacing, notes=(*scan.notes, note), total=scan.total, warnings=scan.warnings
    )
