"""The nozzle's distances along passes with each of many tool axes, looked at no more often than it takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.clearance.clearance import Clearance

EVERY = 2
"""Of the points of a pass, each second one may be looked at."""
WAVES = (16, 4, 2)
"""Strides of these at which an axis is looked at that may serve all along: it is left out once a pose is not free."""
STRIDES = (4, 2, 1)
"""Strides of these at which axes are looked at that serve in part."""


class PoseTable:
    """Bounds of the nozzle's distance at some of the points of passes, with each of the axes (M,3).

    ``needed``: distance that the nozzle has to keep; ``room``: a larger one that is better.
    """

    def __init__(self, lines: Sequence[Floats], axes: Floats, clearance: Clearance, needed: float, room: float) -> None:
        """``lines``: points (N,3) of each pass."""
        some = [np.append(line[:-1:EVERY], line[-1:], axis=0) for line in lines]
        self.axes, self.needed, self.room = axes, needed, room
        self._clearance = clearance
        self._points = np.concatenate(some)
        self._ends = np.cumsum([0, *map(len, some)])
        self._low, self._high = np.full((2, len(self._points), len(axes)), np.nan)

    def find_room(self) -> Floats:
        """The least of the upper bounds (L,M) along each pass with each axis, from each fourth of its points. Where
        it is below ``needed``, not all of these were looked at."""
        counts = np.diff(self._ends)
        least = np.full((len(counts), len(self.axes)), np.inf)
        for stride in WAVES:
            rows = np.concatenate([self._list_rows(k, stride) for k in range(len(counts))])
            line = np.searchsorted(self._ends, rows, side="right") - 1
            is_open = least[line] >= self.needed
            self._look(rows, is_open)
            np.minimum.at(least, line, np.where(is_open, self._high[rows], np.inf))
        return least

    def bound(self, chosen: Sequence[int]) -> list[tuple[Floats, Floats]]:
        """Two bounds (K,M) at the points of each of the ``chosen`` passes. A pose between two that are not free is not
        looked at: it has the bounds of the one before."""
        for stride in STRIDES:
            if stride != STRIDES[0]:
                for k in chosen:
                    self._fill_shut(k, stride)
            self._look(np.concatenate([self._list_rows(k, stride) for k in chosen]))
        return [
            (self._low[self._ends[k] : self._ends[k + 1]], self._high[self._ends[k] : self._ends[k + 1]])
            for k in chosen
        ]

    def _list_rows(self, line: int, stride: int) -> Ints:
        """The rows of a pass at a stride, with its last."""
        start, stop = self._ends[line], self._ends[line + 1]
        return np.append(np.arange(start, stop - 1, stride), stop - 1)

    def _fill_shut(self, line: int, stride: int) -> None:
        """Fills in the poses of a pass at a stride that lie between two that are not free."""
        wider = self._list_rows(line, 2 * stride)
        inner = np.setdiff1d(self._list_rows(line, stride), wider)
        place = np.searchsorted(wider, inner)
        before, after = wider[place - 1], wider[place]
        is_shut = (self._high[before] < self.needed) & (self._high[after] < self.needed)
        is_shut &= np.isnan(self._high[inner])
        for table in (self._low, self._high):
            table[inner] = np.where(is_shut, table[before], table[inner])

    def _look(self, rows: Ints, wanted: Flags | bool = True) -> None:
        """Bounds the poses of rows (K,) that are ``wanted`` (K,M) and not known yet."""
        row, column = np.nonzero(wanted & np.isnan(self._high[rows]))
        own = rows[row]
        low, high = self._clearance.bound(self._points[own], self.axes[column], self.room)
        self._low[own, column], self._high[own, column] = low, high
