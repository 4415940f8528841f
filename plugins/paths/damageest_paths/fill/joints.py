"""Joins lines whose ends are near into one pass, where that makes no reversal; rounds the corners that are left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.regions import is_within
from damageest_paths.fill.trim import crosses, is_closed

REVERSAL, WINDOW = np.radians(150.0), 0.25
"""Turn of the way from which a pass comes back on itself, and the stretch in bead widths within which it turns so."""
SHARP = np.radians(135.0)
"""Largest turn from a line into a link, and from a link into a line."""
LINK, OVERLAP = 1.6, 1e-6
"""Bead widths between the ends of two lines up to which they become one, and up to which their ends are one place."""
LOOK = 0.3
"""Bead widths along a line over which its direction at an end is taken."""
FINE = 0.1
"""Bead widths between the places of a link at which it is looked whether it may be there."""
SHY = 0.3
"""Bead widths before its start at which a ring ends that is joined with another line: its bead's end is round."""
SMOOTH, CORNER = 0.18, np.radians(20.0)
"""Radius of a rounded corner in bead widths, and the turn from which one is rounded."""
FACET = np.radians(22.5)
"""Largest turn between two moves of a rounded corner."""


def join_ends(lines: Sequence[Floats], within: Any, width: float) -> list[tuple[Floats, list[int]]]:
    """The lines (K,2), joined where their ends are near and the straight way between lies in the region ``within``,
    None for everywhere; with the numbers of the lines that each has.

    The nearest ends are joined first. A closed line begins where the other ends, and runs the way that turns less. No
    link crosses one of its two lines, or makes a reversal.
    """
    left: dict[int, tuple[Floats, list[int]]] = {k: (line, [k]) for k, line in enumerate(lines)}
    found = [way for k in left for n in left if k < n for way in _list_links(k, left[k][0], n, left[n][0], width)]
    while found:
        found.sort(key=lambda way: (way[0], way[1], way[2]), reverse=True)
        _, first, second, before, after = found.pop()
        if not _is_possible(before, after, within, width):
            continue
        numbers = [*left.pop(first)[1], *left.pop(second)[1]]
        skip = int(np.linalg.norm(after[0] - before[-1]) <= OVERLAP * width)
        line, key = np.concatenate([before, after[skip:]]), max(first, second, *left, -1) + 1
        found = [way for way in found if not {first, second} & {way[1], way[2]}]
        for k, (other, _) in left.items():
            found += _list_links(k, other, key, line, width)
        left[key] = (line, numbers)
    return list(left.values())


def _list_links(
    first: int, one: Floats, second: int, other: Floats, width: float
) -> list[tuple[float, int, int, Floats, Floats]]:
    """The ways from the end of one line to the start of the other: what each costs, both numbers, and the lines as
    they are run, the one that is run first before the other."""
    if is_closed(one) and is_closed(other):
        gaps = np.linalg.norm(one[:-1, None] - other[None, :-1], axis=2)
        i, j = np.unravel_index(int(gaps.argmin()), gaps.shape)
        if gaps[i, j] > LINK * width:
            return []
        starts, stops = _open_at(one, one[i], width), _open_at(other, other[j], width)
        pairs = [(a, b) for a in starts for b in stops]
    elif is_closed(one) or is_closed(other):
        ring, line = (one, other) if is_closed(one) else (other, one)
        pairs = []
        for open_ in (line, line[::-1]):
            gap = float(np.linalg.norm(ring[:-1] - open_[-1], axis=1).min())
            if gap <= LINK * width:
                pairs += [(open_, each) for each in _open_at(ring, open_[-1], width)]
    else:
        if min(np.linalg.norm(a - b) for a in one[[0, -1]] for b in other[[0, -1]]) > LINK * width:
            return []
        pairs = [(a, b) for a in (one, one[::-1]) for b in (other, other[::-1])]
    found = []
    for before, after in pairs:
        far = float(np.linalg.norm(after[0] - before[-1]))
        if far <= LINK * width:
            found.append((far + 0.2 * width * _measure_turn(before, after, width), first, second, before, after))
    return found


def _open_at(ring: Floats, place: Floats, width: float) -> list[Floats]:
    """A closed line from its corner nearest to a place (2,) on, either way round; it ends before it closes."""
    at = int(np.argmin(np.linalg.norm(ring[:-1] - place, axis=1)))
    turned = np.roll(ring[:-1], -at, axis=0)
    return [open_ring(one, SHY * width) for one in (turned, np.roll(turned[::-1], 1, axis=0))]


def open_ring(ring: Floats, gap: float) -> Floats:
    """A ring (K,2), without its first corner again, as a line that ends ``gap`` before it closes, or halfway."""
    line = np.concatenate([ring, ring[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    stop = max(at[-1] - gap, at[-1] / 2)
    end = np.array([np.interp(stop, at, line[:, k]) for k in range(2)])
    return np.concatenate([line[at < stop - 1e-9], end[None]])


def _direct(line: Floats, width: float) -> Floats:
    """The direction (2,) in which a line ends."""
    back = np.linalg.norm(line - line[-1], axis=1) >= LOOK * width
    start = line[np.flatnonzero(back)[-1]] if back.any() else line[0]
    way = line[-1] - start
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-300))


def _measure_turn(before: Floats, after: Floats, width: float) -> float:
    """The largest turn in radians where two lines are linked."""
    leaving, arriving = _direct(before, width), -_direct(after[::-1], width)
    link = after[0] - before[-1]
    far = float(np.linalg.norm(link))
    if far <= FINE * width:
        return float(np.arccos(np.clip(leaving @ arriving, -1, 1)))
    turns = [np.arccos(np.clip(leaving @ link / far, -1, 1)), np.arccos(np.clip(arriving @ link / far, -1, 1))]
    total = np.arccos(np.clip(leaving @ arriving, -1, 1)) if far <= WINDOW * width else 0.0
    return float(max(*turns, total))


def _is_possible(before: Floats, after: Floats, within: Any, width: float) -> bool:
    if _measure_turn(before, after, width) > SHARP:
        return False
    ends = np.array([before[-1], after[0]])
    far = float(np.linalg.norm(ends[1] - ends[0]))
    if crosses(before, after) or crosses(ends, before[:-1]) or crosses(ends, after[1:]):
        return False
    if within is None or far <= FINE * width:
        return True
    share = np.linspace(0, 1, int(np.ceil(far / (FINE * width))) + 1)[1:-1, None]
    return bool(is_within(ends[0] + share * (ends[1] - ends[0]), within).all())


def find_reversals(line: Floats, width: float) -> list[int]:
    """The corners of a line (K,2) at which it comes back on itself."""
    sides = np.diff(line, axis=0)
    length = np.linalg.norm(sides, axis=1)
    if len(line) < 3:
        return []
    at = np.concatenate([[0.0], np.cumsum(length)])
    unit = sides / np.maximum(length, 1e-300)[:, None]
    # at corners, and in the middle of short sides between two
    short = np.flatnonzero(length[1:-1] < WINDOW * width) + 1
    places = np.concatenate([at[1:-1], (at[short] + at[short + 1]) / 2])
    corner = np.concatenate([np.arange(1, len(line) - 1), short])
    half = WINDOW / 2 * width
    low = np.clip(np.searchsorted(at, np.maximum(places - half, 1e-12), side="right") - 1, 0, len(sides) - 1)
    high = np.clip(np.searchsorted(at, np.minimum(places + half, at[-1] - 1e-12), side="right") - 1, 0, len(sides) - 1)
    turn = np.einsum("ij,ij->i", unit[low], unit[high])
    return sorted(set(corner[turn < np.cos(REVERSAL)].tolist()))


def drop_spurs(line: Floats, width: float) -> Floats:
    """The line (K,2) without corners to which it goes over a short stretch and comes back from."""
    while len(line) > 3:
        sides = np.diff(line, axis=0)
        long = np.linalg.norm(sides, axis=1)
        unit = sides / np.maximum(long, 1e-300)[:, None]
        turn = np.einsum("ij,ij->i", unit[1:], unit[:-1])
        is_spur = (turn < np.cos(REVERSAL)) & (np.minimum(long[1:], long[:-1]) < WINDOW * width)
        if not is_spur.any():
            break
        line = np.delete(line, 1 + int(np.argmin(np.where(is_spur, turn, 1.0))), axis=0)
    return line


def end_at_reversals(line: Floats, width: float) -> list[Floats]:
    """The line without spurs, or its pieces between the places at which it comes back on itself."""
    line = drop_spurs(line, width)
    cuts = find_reversals(line, width)
    if not cuts:
        return [line]
    kept, last = [], 0
    for cut in [*cuts, len(line) - 1]:
        piece = line[last : cut + 1]
        if len(piece) > 1:
            kept.append(piece)
        last = cut
    return kept


def round_corners(line: Floats, width: float) -> Floats:
    """The line (K,2) with arcs for its corners, as wide as the sides beside them permit."""
    keep = np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-9 * width])
    line = line[keep]
    if len(line) < 3:
        return line
    closed = is_closed(line)
    # of a closed one the first corner comes once: its last move ends where the arc there begins
    ring = np.concatenate([line[-2:-1], line[:-1], line[:1]]) if closed else line
    before, after = ring[1:-1] - ring[:-2], ring[2:] - ring[1:-1]
    long = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    ahead, behind = after / long[1][:, None], before / long[0][:, None]
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", ahead, behind), -1, 1))
    found: list[Floats] = [] if closed else [line[:1]]
    reach = np.minimum(SMOOTH * width * np.tan(np.minimum(turn, 2.8) / 2), 0.5 * np.minimum(*long))
    for k in range(len(turn)):
        if turn[k] < CORNER or turn[k] > REVERSAL:
            found.append(ring[k + 1 : k + 2])
            continue
        start, stop = ring[k + 1] - reach[k] * behind[k], ring[k + 1] + reach[k] * ahead[k]
        radius = reach[k] / np.tan(turn[k] / 2)
        side = np.sign(behind[k, 0] * ahead[k, 1] - behind[k, 1] * ahead[k, 0]) or 1.0
        middle = start + radius * side * np.array([-behind[k, 1], behind[k, 0]])
        angle = np.linspace(0, side * turn[k], int(np.ceil(turn[k] / FACET)) + 1)[1:-1]
        away = start - middle
        arc = np.column_stack(
            [np.cos(angle) * away[0] - np.sin(angle) * away[1], np.sin(angle) * away[0] + np.cos(angle) * away[1]]
        )
        found += [start[None], middle + arc, stop[None]]
    if closed:
        found.append(found[0][:1])
    else:
        found.append(line[-1:])
    return np.concatenate(found)
