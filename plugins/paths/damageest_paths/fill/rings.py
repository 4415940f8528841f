"""Rings within a region, and the spiral that they become."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.joints import SHY, WINDOW, find_reversals, open_ring
from damageest_paths.fill.lines import Kind, Line
from damageest_paths.fill.merging import merge_rings
from damageest_paths.fill.middles import draw_middle
from damageest_paths.fill.regions import (
    close_ring,
    cover,
    drop_narrow,
    list_pieces,
    measure_length,
    resample,
    shift_border,
    unite_regions,
)
from damageest_paths.fill.stripes import Bead

SOFT = 0.14
"""Radius in bead widths of the corners of a ring, within which the border of a region is smoothed too."""
INSIDE = 0.004
"""Bead widths that a ring keeps from where no bead may lie."""
SPARE = 1.3
"""How much farther apart than in a reversal the turns of a tip may be that is left out: its ring is made simpler."""
SPIKE = 0.01
"""Area, in squares of the bead's width, from which a ring goes round something narrow in an arc."""
NEXT = 1.0
"""Steps that the next ring inside a ring is off the place a step from its start, at most."""
SLIM = 0.9
"""Share of what the beads of two rings leave between them at most, from which a ring is no line in its middle."""


def soften(inner: Any, free: Any, width: float) -> Any:
    """The region with its border smoothed and its corners round, without what is narrower than a ring may be."""
    if free is not None:
        inner = inner ^ free
    closed = shift_border(shift_border(inner, SOFT * width), -SOFT * width)
    if free is not None:
        closed = (closed ^ shift_border(free, -INSIDE * width)) - _find_spikes(free, width)
    sharp = drop_narrow(closed, SOFT * width, keeps_corners=True)
    found = _blunt(sharp, drop_narrow(closed, SOFT * width), width).simplify(INSIDE / 2 * width)
    return found if free is None else found ^ free


def _find_spikes(free: Any, width: float) -> Any:
    """The places up to `SOFT` round what no bead may lie on and is so narrow that a ring would come back on itself."""
    closed = shift_border(shift_border(free, SOFT * width), -SOFT * width)
    spikes = [piece for piece in list_pieces(closed - free) if piece.area() > SPIKE * width**2]
    return shift_border(unite_regions(spikes), SOFT * width)


def _blunt(sharp: Any, blunt: Any, width: float) -> Any:
    """A region without its tips beyond a ``blunt`` one, where a ring round it would come back on itself."""
    rings = [np.asarray(ring, dtype=np.float64) for ring in sharp.to_polygons()]
    rings = [np.concatenate([ring, ring[:3]]) for ring in rings]
    ends = [ring[number] for ring in rings for number in find_reversals(ring, SPARE * width)]
    if not ends:
        return sharp
    near = cover([end[None] for end in ends], 2 * WINDOW * width)
    return sharp - unite_regions([tip for tip in list_pieces(sharp - blunt) if not (tip ^ near).is_empty()])


def list_levels(inner: Any, bead: Bead) -> tuple[list[Floats], list[Line]]:
    """Rings (K,2) from outside to inside, and the lines in the middle of what is left, where no ring fits."""
    step, width = _choose_step(inner, bead), bead.width
    slim = max(SLIM * (width - step), SOFT / 2 * width)
    rings, middles = read_rings(inner, bead), list[Line]()
    while not inner.is_empty():
        bare, shrunk = shift_border(inner, -width / 2), shift_border(inner, -step)
        # each of the shifts triples the corners of a smooth border
        inner = drop_narrow(shrunk, SOFT / 2 * width, keeps_corners=True)
        inner = _blunt(inner, drop_narrow(inner, SOFT * width), width).simplify(INSIDE / 2 * width)
        for piece in list_pieces(bare):
            own = piece ^ inner
            if not shift_border(own, -slim).is_empty():
                rings += read_rings(own, bead)
            elif not (piece ^ shrunk).is_empty():
                middles += draw_middle(piece, bead)
    return rings, middles


def _choose_step(inner: Any, bead: Bead) -> float:
    """The distance between rings: the bead's, or less where the innermost would else leave a gap too narrow for one."""
    low, high = 0.0, bead.step
    while not shift_border(inner, -high).is_empty():
        low, high = high, 2 * high
    for _ in range(7):
        middle = (low + high) / 2
        low, high = (low, middle) if shift_border(inner, -middle).is_empty() else (middle, high)
    left = low % bead.step
    count = int(np.ceil(low / bead.step))
    return float(bead.step) if left <= 0.48 * bead.width or low < bead.step else float(low / count * 0.995)


def draw_spiral(inner: Any, bead: Bead, ahead: Floats) -> list[Line]:
    """Rings from outside to inside, each linked with the one inside it: it ends before it closes, and goes on there.
    All start in the direction ``ahead`` (2,), so that a line in the middle of a long region begins where they end."""
    rings, middles = list_levels(inner, bead)
    lines: list[Line] = []
    while rings:
        ring, parts = _start_ahead(rings.pop(0), ahead), list[Floats]()
        while True:
            found = [_find_foot(other, ring[0] - bead.step * ahead) for other in rings]
            number = int(np.argmin([far for far, _, _ in found])) if found else 0
            if not found or found[number][0] > NEXT * bead.step:
                break
            parts.append(open_ring(ring, bead.step))
            _, at, foot = found[number]
            ring = _start_at(rings.pop(number), at, foot)
            way = parts[-1][-1] - parts[-1][-2]
            if (ring[1] - ring[-1]) @ way < 0:
                ring = np.roll(ring[::-1], 1, axis=0)
        # round its last corner, so that a line in the middle goes on from there
        last = open_ring(ring, SHY * bead.width if middles else bead.step) if parts else close_ring(ring)
        lines.append(Line(np.concatenate([*parts, last]), "spiral" if parts else "ring"))
    return [*lines, *middles]


def draw_one(inner: Any, bead: Bead, ahead: Floats) -> list[Line]:
    """Rings, merged into as few as may be, and the lines in the middle. They start in the direction ``ahead`` (2,)."""
    rings, middles = list_levels(inner, bead)
    merged = merge_rings(rings, bead.step)
    kind: Kind = "ring" if len(merged) == len(rings) else "spiral"
    return [*[Line(close_ring(_start_ahead(ring, ahead)), kind) for ring in merged], *middles]


def _start_ahead(ring: Floats, ahead: Floats) -> Floats:
    """A ring (K,2) from its corner on that lies in a direction (2,), seen from its middle."""
    away = ring - ring.mean(axis=0)
    share = away @ ahead / np.maximum(np.linalg.norm(away, axis=1), 1e-300)
    return np.roll(ring, -int(np.argmax(np.round(share, 9))), axis=0)


def _find_foot(ring: Floats, place: Floats) -> tuple[float, int, Floats]:
    """How far a ring (K,2) is from a place (2,), the number of the side where it is nearest, and the place there."""
    side = np.roll(ring, -1, axis=0) - ring
    share = np.einsum("ij,ij->i", place - ring, side) / np.maximum(np.einsum("ij,ij->i", side, side), 1e-300)
    foot = ring + np.clip(share, 0.0, 1.0)[:, None] * side
    far = np.linalg.norm(foot - place, axis=1)
    number = int(np.argmin(far))
    return float(far[number]), number, foot[number]


def _start_at(ring: Floats, number: int, place: Floats) -> Floats:
    """A ring that begins at a place (2,) on one of its sides."""
    turned = np.roll(ring, -(number + 1), axis=0)
    near = 1e-9 + 0.05 * float(np.linalg.norm(turned[0] - turned[-1]))
    if np.linalg.norm(turned[0] - place) < near:
        return turned
    if np.linalg.norm(turned[-1] - place) < near:
        return np.roll(turned, 1, axis=0)
    return np.concatenate([place[None], turned])


def start_farthest(ring: Floats, ahead: Floats) -> Floats:
    """A ring (K,2) from its corner on that is farthest in a direction (2,)."""
    return np.roll(ring, -int(np.argmax(np.round((ring - ring.mean(axis=0)) @ ahead, 9))), axis=0)


def read_rings(region: Any, bead: Bead) -> list[Floats]:
    """The outlines of a region as rings (K,2), without the first corner again, with corners not farther apart than the
    bead's width."""
    rings = [np.asarray(ring, dtype=np.float64) for ring in region.to_polygons()]
    rings = [ring for ring in rings if len(ring) > 2 and measure_length(close_ring(ring)) > bead.width / 2]
    return [resample(close_ring(ring), bead.width / 2)[0][:-1] for ring in rings]
