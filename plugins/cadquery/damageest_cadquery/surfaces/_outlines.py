"""Outlines of triangles in a plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise


def cover(triangles: Floats) -> tuple[list[Floats], float]:
    """The outlines (K,2) of the region that triangles (F,3,2) cover, holes too; and the share of their area that lies
    over others."""
    from manifold3d import CrossSection, FillRule

    area = cross_plane(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    turned = np.where((area < 0)[:, None, None], triangles[:, ::-1], triangles)
    whole = CrossSection(list(np.ascontiguousarray(turned)), FillRule.NonZero)
    loops = [np.asarray(loop, np.float64) for loop in whole.to_polygons()]
    return loops, 1 - 2 * whole.area() / max(float(np.abs(area).sum()), 1e-300)


def trace_regions(outlines: Sequence[Floats], size: float, beyond: float = 1.0) -> list[list[Floats]]:
    """For each region within ``outlines`` its outlines (K,2), the outer one first, moved outward by ``beyond`` times
    ``size``; holes smaller than that are closed."""
    from manifold3d import CrossSection, FillRule, JoinType

    whole = CrossSection([np.ascontiguousarray(loop) for loop in outlines], FillRule.Positive).simplify(size / 20)
    whole = whole.offset((beyond + 0.5) * size, JoinType.Round, 2.0, 16).offset(-0.5 * size, JoinType.Round, 2.0, 16)
    regions = []
    for each in whole.simplify(size / 8).decompose():
        loops = [np.asarray(loop, np.float64) for loop in each.to_polygons()]
        regions.append(sorted(loops, key=lambda loop: -np.ptp(loop, axis=0).prod()))
    return regions


def cross_plane(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def walk_outline(loop: Floats, step: float) -> tuple[Floats, Floats]:
    """Points (N,2) about ``step`` apart on a closed outline, and the unit normals (N,2) there, outward."""
    ends = np.roll(loop, -1, axis=0) - loop
    lengths = np.linalg.norm(ends, axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.linspace(0, along[-1], max(8, round(along[-1] / step)), endpoint=False)
    closed = np.concatenate([loop, loop[:1]])
    points = np.column_stack([np.interp(places, along, closed[:, k]) for k in range(2)])
    way = np.roll(points, -2, axis=0) - np.roll(points, 2, axis=0)  # outer outlines run left about, holes right about
    way = normalise(way)
    return points, np.column_stack([way[:, 1], -way[:, 0]])
