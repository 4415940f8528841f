"""Scans with more points than are kept: read in pieces, thinned evenly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Scan, Vector
from damageest.geometry.units import FARTHEST, canonical_unit, unit_factor
from damageest.io.points.streams import PointStream, open_stream
from damageest.io.scans import make_scan

LEAST_BYTES = 2
"""Bytes of a point in a file at least; a file too small for the points that are kept is not looked into."""


@dataclass(frozen=True)
class LargeScan:
    """Files in one frame with ``count`` points together, and their lengths in ``unit``, the job's. ``source``,
    ``given``: unit of the files and positions of the scanners, as `read_scan` takes them."""

    streams: tuple[PointStream, ...]
    unit: str
    source: str | None
    given: tuple[Vector | None, ...]

    @property
    def count(self) -> int:
        return sum(stream.count for stream in self.streams)

    def read(self) -> Iterator[Scan]:
        """The points piece by piece, without those that are not finite or too far away. The viewpoints of a piece are
        those of its file; `JoinedViews` gives them numbers of the whole."""
        for stream, at in zip(self.streams, self.given, strict=True):
            for piece in stream.read():
                factor = unit_factor(canonical_unit(self.source or piece.unit or self.unit), self.unit)
                viewpoints, view = piece.viewpoints, piece.view
                if at is not None:
                    viewpoints, view = np.array([at], dtype=np.float64), np.zeros(len(piece.points), np.int64)
                points = np.asarray(piece.points * factor)
                sound = (np.abs(points) <= FARTHEST).all(axis=1)  # False for what is not finite
                scan = Scan(
                    points,
                    unit=canonical_unit(self.unit),
                    viewpoints=None if viewpoints is None or view is None else viewpoints * factor,
                    view=None if viewpoints is None or view is None else view.astype(np.int32),
                )
                yield scan if sound.all() else scan.take(np.asarray(sound))

    def thin(self, most: int) -> Scan:
        """About ``most`` of the points, chosen evenly at random (seeded); ``total`` of the scan says of how many."""
        rng, share = np.random.default_rng(0), most / max(self.count, 1)
        joined = JoinedViews()
        for piece in self.read():
            joined.add(piece, np.asarray(rng.random(len(piece.points)) < share), rng)
        points, viewpoints, view = joined.take()
        paths = tuple(str(stream.path) for stream in self.streams)
        scan = make_scan(points, None, self.unit, paths=paths, viewpoints=viewpoints, view=view)
        return replace(scan, total=self.count)


class JoinedViews:
    """Points chosen from several pieces, with equal scanner positions as one view."""

    def __init__(self) -> None:
        self._points: list[Floats] = []
        self._views: list[Ints] = []
        self._lots: list[Floats] = []
        self._share = 1.0
        self._numbers: dict[bytes, int] = {}
        self._places: list[Floats] = []

    def add(self, piece: Scan, chosen: Flags, rng: np.random.Generator) -> None:
        """Adds the ``chosen`` (N,) points of a piece, as large a share of them as of the earlier ones."""
        lots = rng.random(len(chosen))
        chosen = chosen & (lots < self._share)
        self._points.append(piece.points[chosen])
        self._views.append(self._number_views(piece)[chosen])
        self._lots.append(lots[chosen])

    def halve_to(self, most: int) -> None:
        """Takes every second point away, at random, until at most ``most`` are left."""
        while sum(map(len, self._points)) > most:
            self._share /= 2
            kept = [lots < self._share for lots in self._lots]
            self._points = [values[keep] for values, keep in zip(self._points, kept, strict=True)]
            self._views = [values[keep] for values, keep in zip(self._views, kept, strict=True)]
            self._lots = [values[keep] for values, keep in zip(self._lots, kept, strict=True)]

    def _number_views(self, piece: Scan) -> Ints:
        """The number (N,) of each point's view in the whole; -1 where its position is not known."""
        if piece.viewpoints is None or piece.view is None:
            return np.full(len(piece.points), -1)
        own = []
        for place in piece.viewpoints:
            key = place.tobytes()
            if key not in self._numbers:
                self._numbers[key] = len(self._places)
                self._places.append(place)
            own.append(self._numbers[key])
        return np.array([*own, -1])[piece.view]

    def take(self) -> tuple[Floats, Floats | None, Ints | None]:
        """Points (N,3); viewpoints (V,3) and the view (N,) of each point, both None where none is known."""
        points = np.concatenate(self._points) if self._points else np.empty((0, 3))
        view = np.concatenate(self._views) if self._views else np.empty(0, np.int64)
        if not (view >= 0).any():
            return points, None, None
        return points, np.array(self._places), view


def open_large_scan(
    paths: Sequence[Path],
    unit: str,
    source: str | None,
    viewpoints: Sequence[Vector | None],
    most: int,
) -> LargeScan | None:
    """The files as a LargeScan where they hold more than ``most`` points and all can be read in pieces; else None."""
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    if sum(sizes) < LEAST_BYTES * most:
        return None
    streams = [stream for path in paths if (stream := open_stream(path)) is not None]
    large = LargeScan(tuple(streams), unit, source, tuple(viewpoints))
    return large if len(streams) == len(paths) and large.count > most else None
