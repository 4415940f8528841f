"""Regions of a plane as manifold3d's CrossSection, which has the polygons and offsets of Clipper2.

A region is typed Any. Lengths are in the job's unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats

ROUND = 24
"""Corners of a full circle where a bead's end is drawn as a polygon."""


def make_region(polygons: Sequence[Floats]) -> Any:
    """The union of closed polygons (K,2); those that are wound clockwise are holes."""
    from manifold3d import CrossSection, FillRule

    return CrossSection(list(polygons), FillRule.Positive) if len(polygons) else CrossSection()


def unite_regions(regions: Sequence[Any]) -> Any:
    """The union of regions; empty without any."""
    from manifold3d import CrossSection, OpType

    kept = [region for region in regions if not region.is_empty()]
    return CrossSection.batch_boolean(kept, OpType.Add) if kept else CrossSection()


def shift_border(region: Any, distance: float) -> Any:
    """The region grown by ``distance`` with round corners, or shrunk where that is negative."""
    from manifold3d import JoinType

    if region.is_empty() or not distance:
        return region
    return region.offset(distance, JoinType.Round, 2.0, ROUND)


def turn_points(points: Floats, angle: float) -> Floats:
    """Points (N,2), turned about 0 by an angle in radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def cover(lines: Sequence[Floats], width: float) -> Any:
    """The region that beads of a width cover whose centre lines are the polylines (K,2). Their ends are round."""
    from manifold3d import CrossSection, FillRule

    outlines = [outline for line in lines for outline in _outline(line, width / 2)]
    return CrossSection(outlines, FillRule.NonZero) if outlines else CrossSection()


def _outline(line: Floats, radius: float) -> list[Floats]:
    """A rounded rectangle (ROUND + 2, 2) round each piece of a polyline."""
    if len(line) == 1:
        line = np.concatenate([line, line])
    start, stop = line[:-1], line[1:]
    along = stop - start
    angle = np.arctan2(along[:, 1], along[:, 0])
    half = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)
    ahead, behind = angle[:, None] + half, angle[:, None] + half + np.pi
    front = stop[:, None] + radius * np.stack([np.cos(ahead), np.sin(ahead)], axis=2)
    back = start[:, None] + radius * np.stack([np.cos(behind), np.sin(behind)], axis=2)
    return list(np.concatenate([front, back], axis=1))


def measure_length(line: Floats) -> float:
    """The length of a polyline (K,2) or (K,3)."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def find_main_angle(region: Any) -> float:
    """The angle in radians of the longer side of the smallest rectangle round a region."""
    (outline,) = region.hull().to_polygons() or (np.zeros((1, 2)),)
    sides = np.roll(outline, -1, axis=0) - outline
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    best, found = np.inf, 0.0
    for angle in np.unique(np.round(np.mod(angles, np.pi / 2), 9)):
        width, height = np.ptp(turn_points(outline, -float(angle)), axis=0)
        if width * height < best * (1 - 1e-9):
            best, found = width * height, float(angle) + (0.0 if width >= height else np.pi / 2)
    return found
