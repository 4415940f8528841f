"""Lines in the middle of what is narrower than a bead, and where a line may not quite be moved aside."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.lines import Line
from damageest_paths.fill.regions import find_main_angle, is_within, list_pieces, resample, shift_border, turn_points
from damageest_paths.fill.stripes import Bead, fill_with_rows
from damageest_paths.fill.trim import trim_line

NEAR, WITHIN = 0.2, 0.004
"""Bead widths by which a line is moved to where a bead may lie, what is farther off is cut; and how far within."""
STATION = 0.25
"""Bead widths between the places at which the middle of a thin piece is taken."""


def draw_thin(region: Any, bead: Bead, free: Any) -> list[Line]:
    """The middle lines of a region narrower than a bead, as far as the middles of beads may lie there."""
    lines = draw_middle(region, bead)
    if free is None:
        return lines
    return [Line(piece, line.kind) for line in lines for piece in move_inside(line.points, free, bead.width)]


def draw_middle(region: Any, bead: Bead) -> list[Line]:
    """A line midway between the sides of a region along its long axis; rows where it has branches."""
    from manifold3d import CrossSection

    angle = find_main_angle(region)
    turned = region.rotate(float(-np.degrees(angle)))
    left, low, right, high = turned.bounds()
    count = max(2, int(np.ceil((right - left) / (STATION * bead.width))) + 1)
    inset = min(bead.inset, 0.4 * (right - left))
    stations = np.linspace(left + inset, right - inset, count)
    thick = 1e-3 * bead.width
    middle = []
    for x in stations.tolist():
        strip = CrossSection.square((thick, high - low + 2 * thick)).translate((x - thick / 2, low - thick))
        spans = [piece.bounds() for piece in list_pieces(turned ^ strip)]
        if not spans:
            continue
        bottom, top = min(span[1] for span in spans), max(span[3] for span in spans)
        if top - bottom > 1.3 * bead.width:
            return [Line(row, "row") for row in fill_with_rows(region, bead, angle, True)]
        middle.append((x, (bottom + top) / 2))
    if len(middle) < 2:
        return [Line(row, "row") for row in fill_with_rows(region, bead, angle, True)]
    points = np.array(middle)
    if len(points) > 4:
        smooth = points[:, 1].copy()
        smooth[1:-1] = (points[:-2, 1] + 2 * points[1:-1, 1] + points[2:, 1]) / 4
        points[:, 1] = smooth
    return [Line(turn_points(points, angle), "row")]


def move_inside(line: Floats, free: Any, width: float) -> list[Floats]:
    """The line with its points moved into a region where they are a little beside it; the pieces of it where it is
    farther off."""
    if is_within(line, free).all() and len(trim_line(line, free, width)) == 1:
        return [line]
    points, _ = resample(line, 0.1 * width)
    out = np.flatnonzero(~is_within(points, free))
    target = shift_border(free, -WITHIN * width)
    if not len(out) or target.is_empty():
        return trim_line(line, free, width)
    rings = [np.asarray(ring, dtype=np.float64) for ring in target.to_polygons()]
    start = np.concatenate(rings)
    side = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    away = points[out][:, None] - start
    share = np.clip((away * side).sum(2) / np.maximum((side**2).sum(1), 1e-300), 0, 1)
    foot = start + share[:, :, None] * side
    gap = np.linalg.norm(points[out][:, None] - foot, axis=2)
    best = gap.argmin(axis=1)
    near = gap[np.arange(len(out)), best] <= NEAR * width
    points[out[near]] = foot[np.arange(len(out)), best][near]
    return trim_line(points, free, width)
