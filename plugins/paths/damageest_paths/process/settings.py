"""Gives each move of a path what the table of the process says, and the waits between neighbouring beads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import DepositPath, Flags, Floats, Solid
from damageest.errors import StageError
from damageest_paths.process.calibration import Trial, describe_beads, predict_beads
from damageest_paths.process.channels import KINDS, SPEED, Setting
from damageest_paths.process.interpass import add_waits, measure_rest
from damageest_paths.process.places import cut_moves, measure_radius, measure_widths

MUCH_WAITING = 0.2
"""Share of the time from which a note says how much of it the tool waits."""


@dataclass(frozen=True, eq=False)
class Places:
    """The moves of a ``path`` as the rows of the table see them. ``body``, ``left``: what it builds up, and what is
    left of the part."""

    path: DepositPath
    body: Solid
    left: Solid | None

    @cached_property
    def kinds(self) -> Any:
        """The kind (N,) of the pass of each move."""
        return np.array(self.path.kinds or ("row",) * self.path.passes)[self.path.number - 1]

    @cached_property
    def is_first(self) -> Flags:
        """Whether each move (N,) belongs to the first pass of its layer."""
        path = self.path
        places = np.stack([path.part, path.layer], axis=1)
        firsts = {tuple(place): int(number) for place, number in zip(places[::-1], path.number[::-1], strict=True)}
        return np.asarray(np.array([firsts[tuple(place)] for place in places]) == path.number)

    @cached_property
    def radius(self) -> Floats:
        return measure_radius(self.path)

    @cached_property
    def thickness(self) -> Floats:
        return measure_widths(self.path, self.body, self.left)

    @cached_property
    def rest(self) -> Floats:
        return measure_rest(self.path)


def apply_table(
    path: DepositPath, table: Sequence[Setting], wait: float, body: Solid, left: Solid | None
) -> DepositPath:
    """The path with its channels, in the order in which the table names them, with the speeds of the table, and with
    waits between neighbouring beads, at least ``wait`` seconds. Of rows that hold for a move, the last counts. Travel
    keeps its speed, and has the values of the pass that it leads to.

    Where rows hold for parts of passes, moves are cut to bead widths; what has the same settings is one move again.
    """
    if not len(path.points):
        return path
    is_local = any(row.is_local for row in table)
    found, is_end = cut_moves(path) if is_local or wait else (path, np.ones(len(path.points), bool))
    places = Places(found, body, left)
    feed = _set_speeds(places, [row for row in table if row.rest is None])
    # a bead that is higher is as much slower
    found = replace(found, feed=feed * found.planned_sizes[:, 1] / found.sizes[:, 1])
    found = add_waits(found, wait)
    names = list(dict.fromkeys(name for row in table for name in row.set if name != SPEED))
    if names:
        places = replace(places, path=found)
        found = replace(found, channels=tuple(names), values=_set_values(places, table, names))
    return _tell_waits(_merge(found, is_end))


def add_sizes(path: DepositPath, trials: Sequence[Trial]) -> DepositPath:
    """The path with the width and height of the bead of each move by the trials, and notes where they are not as
    planned. Raises StageError for settings of which the trials say nothing."""
    own = np.flatnonzero(path.on)
    if not trials or not len(own):
        return path
    values = {SPEED: path.feed[own]}
    if path.values is not None:
        values.update(zip(path.channels, path.values[own].T, strict=True))
    sizes = path.planned_sizes
    heights = sizes[own, 1]
    try:
        sizes[own] = predict_beads(trials, values)
    except ValueError as error:
        raise StageError(
            f"calibration: {error}", "more rows of path.calibration, or other values in path.process"
        ) from error
    notes = describe_beads(sizes[own], path.width, heights)
    return replace(path, bead_sizes=sizes, notes=(*path.notes, *notes))


def _select(row: Setting, places: Places) -> Flags:
    """Whether the row holds for each move (N,)."""
    path = places.path
    own = np.ones(len(path.points), bool)
    if row.layer is not None:
        low, high = row.layer if isinstance(row.layer, tuple) else (row.layer, row.layer)
        own &= (path.layer >= low) & (path.layer <= high)
    if row.kind is not None:
        own &= np.isin(places.kinds, KINDS.get(row.kind, (row.kind,)))
    if row.first:
        own &= places.is_first
    if row.radius is not None:
        own &= row.radius.holds(places.radius)
    if row.thickness is not None:
        own &= row.thickness.holds(places.thickness)
    if row.rest is not None:
        own &= row.rest.holds(places.rest)
    return own


def _tell_waits(path: DepositPath) -> DepositPath:
    share = path.wait_minutes / path.minutes
    if share <= MUCH_WAITING:
        return path
    note = f"the tool waits {path.wait_minutes:.3g} min of {path.minutes:.3g} for beads to cool down (path.interpass)"
    return replace(path, notes=(*path.notes, note))


def _set_speeds(places: Places, table: Sequence[Setting]) -> Floats:
    feed = places.path.feed.copy()
    for row in table:
        if SPEED in row.set:
            feed[_select(row, places) & places.path.on] = row.set[SPEED]
    return feed


def _set_values(places: Places, table: Sequence[Setting], names: Sequence[str]) -> Floats:
    values = np.zeros((len(places.path.points), len(names)))
    for row in table:
        own = _select(row, places)
        for name, value in row.set.items():
            if name != SPEED:
                values[own, names.index(name)] = value
    # travel has what the pass begins with: places are those of what deposits
    path = places.path
    starts = np.flatnonzero(~path.on[:-1] & path.on[1:]) + 1
    leads = np.searchsorted(starts, np.arange(len(path.on)))
    off = np.flatnonzero(~path.on & (leads < len(starts)))
    values[off] = values[starts[leads[off]]]
    return values


def _merge(path: DepositPath, is_end: Flags) -> DepositPath:
    """The path without the points (N,) that are no end of a move of the one before, where the settings go on."""
    same = path.feed[:-1] == path.feed[1:]
    if path.values is not None:
        same &= (path.values[:-1] == path.values[1:]).all(axis=1)
    if path.bead_sizes is not None:
        same &= (path.bead_sizes[:-1] == path.bead_sizes[1:]).all(axis=1)
    kept = is_end.copy()
    kept[:-1] |= ~same
    if kept.all():
        return path
    columns = ("points", "axes", "normals", "feed", "on", "layer", "number", "part", "values", "dwell", "bead_sizes")
    own = {name: getattr(path, name) for name in columns}
    return replace(path, **{name: value[kept] for name, value in own.items() if value is not None})
