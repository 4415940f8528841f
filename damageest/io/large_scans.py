"""Scans with more points than are kept: read in pieces, thinned evenly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Scan, Vector
from damageest.geometry.units import FARTHEST, canonical_unit, unit_factor
from damageest.io.points.streams import PointStream, open_stream
from damageest.io.scan_notes import ConfidenceCount, UnitNotes
from damageest.io.scans import join_attributes, make_scan

LEAST_BYTES = 2
"""Bytes of a point in a file at least; a file too small for the points that are kept is not looked into."""


@dataclass(frozen=True)
class LargeScan:
    """Files in one frame with ``count`` points together, and their lengths in ``unit``, the job's. ``source``,
    ``given``, ``min_confidence``: unit of the files, positions of the scanners, and the least confidence, as
    `read_scan` takes them."""

    streams: tuple[PointStream, ...]
    unit: str
    source: str | None
    given: tuple[Vector | None, ...]
    min_confidence: float | None = None

    @property
    def count(self) -> int:
        return sum(stream.count for stream in self.streams)

    def read(self) -> Iterator[Scan]:
        """The points piece by piece, without those that are not finite, too far away, or of a confidence too low. The
        viewpoints of a piece are those of its file; `JoinedViews` gives them numbers of the whole."""
        return self._read(UnitNotes(self.source, self.unit), ConfidenceCount(self.min_confidence))

    def _read(self, units: UnitNotes, confidence: ConfidenceCount) -> Iterator[Scan]:
        for stream, at in zip(self.streams, self.given, strict=True):
            for piece in stream.read():
                factor = unit_factor(units.settle(stream.path, piece.unit, piece.unit_said), self.unit)
                viewpoints, view = piece.viewpoints, piece.view
                if at is not None:
                    viewpoints, view = np.array([at], dtype=np.float64), np.zeros(len(piece.points), np.int64)
                points = np.asarray(piece.points * factor)
                sound = (np.abs(points) <= FARTHEST).all(axis=1)  # False for what is not finite
                if (kept := confidence.choose(piece.confidence, len(points))) is not None:
                    sound &= kept
                scan = Scan(
                    points,
                    piece.normals,
                    canonical_unit(self.unit),
                    viewpoints=None if viewpoints is None or view is None else viewpoints * factor,
                    view=None if viewpoints is None or view is None else view.astype(np.int32),
                    colours=piece.colours,
                    confidence=piece.confidence,
                )
                yield scan if sound.all() else scan.take(np.asarray(sound))

    def thin(self, most: int) -> Scan:
        """About ``most`` of the points, chosen evenly at random (seeded); ``total`` of the scan says of how many."""
        rng, share = np.random.default_rng(0), most / max(self.count, 1)
        units, confidence = UnitNotes(self.source, self.unit), ConfidenceCount(self.min_confidence)
        joined = JoinedViews()
        for piece in self._read(units, confidence):
            joined.add(piece, np.asarray(rng.random(len(piece.points)) < share), rng)
        confidence.require([stream.path for stream in self.streams])
        paths = tuple(str(stream.path) for stream in self.streams)
        found = joined.take()
        notes = (*units.notes(), *confidence.notes())
        scan = make_scan(
            found.points, found.normals, self.unit, paths=paths, notes=notes, viewpoints=found.viewpoints,
            view=found.view, colours=found.colours, confidence=found.confidence,
        )  # fmt: skip
        return replace(scan, total=self.count, warnings=(*units.warnings(), *confidence.warnings()))


class JoinedViews:
    """Points chosen from several pieces, with equal scanner positions as one view."""

    def __init__(self) -> None:
        self._pieces: list[Scan] = []
        self._views: list[NDArray[np.int32]] = []
        self._lots: list[Floats] = []
        self._share = 1.0
        self._numbers: dict[bytes, int] = {}
        self._places: list[Floats] = []

    def add(self, piece: Scan, chosen: Flags, rng: np.random.Generator) -> None:
        """Adds the ``chosen`` (N,) points of a piece, as large a share of them as of the earlier ones."""
        lots = rng.random(len(chosen))
        chosen = chosen & (lots < self._share)
        self._pieces.append(piece.take(chosen))
        self._views.append(self._number_views(piece)[chosen])
        self._lots.append(lots[chosen])

    def halve_to(self, most: int) -> None:
        """Takes every second point away, at random, until at most ``most`` are left."""
        while sum(map(len, self._lots)) > most:
            self._share /= 2
            kept = [lots < self._share for lots in self._lots]
            self._pieces = [piece.take(keep) for piece, keep in zip(self._pieces, kept, strict=True)]
            self._views = [values[keep] for values, keep in zip(self._views, kept, strict=True)]
            self._lots = [values[keep] for values, keep in zip(self._lots, kept, strict=True)]

    def _number_views(self, piece: Scan) -> NDArray[np.int32]:
        """The number (N,) of each point's view in the whole; -1 where its position is not known."""
        if piece.viewpoints is None or piece.view is None:
            return np.full(len(piece.points), -1, np.int32)
        own = []
        for place in piece.viewpoints:
            key = place.tobytes()
            if key not in self._numbers:
                self._numbers[key] = len(self._places)
                self._places.append(place)
            own.append(self._numbers[key])
        return np.array([*own, -1], np.int32)[piece.view]

    def take(self) -> Scan:
        """The points; their viewpoints and views are None where none is known. They are held no longer."""
        pieces, views = self._pieces, self._views
        self._pieces, self._views, self._lots = [], [], []
        points = np.concatenate([piece.points for piece in pieces]) if pieces else np.empty((0, 3))
        view = np.concatenate(views) if pieces else np.empty(0, np.int32)
        known = bool((view >= 0).any())
        normals = [piece.normals for piece in pieces if piece.normals is not None]
        colours, confidence = join_attributes(pieces)
        return Scan(
            points,
            np.concatenate(normals) if normals and len(normals) == len(pieces) else None,
            viewpoints=np.array(self._places) if known else None,
            view=view if known else None,
            colours=colours,
            confidence=confidence,
        )


def open_large_scan(
    paths: Sequence[Path],
    unit: str,
    source: str | None,
    viewpoints: Sequence[Vector | None],
    most: int,
    min_confidence: float | None = None,
) -> LargeScan | None:
    """The files as a LargeScan where they hold more than ``most`` points and all can be read in pieces; else None."""
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    if sum(sizes) < LEAST_BYTES * most:
        return None
    streams = [stream for path in paths if (stream := open_stream(path)) is not None]
    large = LargeScan(tuple(streams), unit, source, tuple(viewpoints), min_confidence)
    return large if len(streams) == len(paths) and large.count > most else None
