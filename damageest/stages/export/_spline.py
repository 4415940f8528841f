"""Fits a B-spline to an inner damage surface that is a height field over a plane: one smooth face for CAM."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import NdBSpline

from damageest.artefacts import Floats, Ints, Mesh, Surface
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.height_spline import DEGREE, fit_height_plane, fit_height_spline
from damageest.stages.export import Patch, Spline

_OVERHANG = 0.01
"""Largest share of the area that may overhang, as slivers do; the deviation there is measured all the same."""
_SPANS = (4, 8, 16, 32, 64)
_SPECK = 0.01
_SAMPLES = 400


def fit_spline(surface: Surface, tolerance: float) -> tuple[Patch | None, Spline]:
    """The coarsest spline within half of ``tolerance`` of the surface, else the one with the smallest deviation.

    Its parameters are lengths in the plane over which the surface is a height field.

    Returns:
        The spline, None where none is within the tolerance; and its deviation, or the reason why there is none.
    """
    axes, overhang = fit_height_plane(surface)
    if overhang > _OVERHANG:
        return None, Spline(reason=f"the surface is no height field over any plane: {overhang:.1%} of it overhangs")
    origin = surface.bounds.mean(axis=0)
    points = (surface.vertices - origin) @ axes.T
    corners = points[surface.faces]
    data = np.concatenate([points, corners.mean(axis=1)])
    rims = _trace_outlines(corners[..., :2], tolerance)
    upright = np.abs(surface.vertex_normals @ axes[2])
    best: tuple[float, Patch] | None = None
    for spans in _SPANS:
        knots, poles = fit_height_spline(data, spans)
        along = np.abs(NdBSpline(knots, poles[..., 2], DEGREE)(points[:, :2]) - points[:, 2]) * upright
        if along.max() > 2 * tolerance and spans != _SPANS[-1]:
            continue  # too far off; this test is fast
        off = _measure_deviation(points, surface, knots, poles)
        if best is None or off < best[0]:
            best = off, Patch(DEGREE, knots, origin + poles @ axes, tuple(rims))
        if off <= tolerance / 2:
            break
    assert best is not None
    if best[0] > tolerance:
        return None, Spline(
            best[0], reason=f"the best spline deviates by {best[0]:.3g}, more than the tolerance {tolerance:.3g}"
        )
    return best[1], Spline(best[0], bool(rims))


def _trace_outlines(triangles: Floats, tolerance: float) -> list[Floats]:
    """The outlines (K,2) of the region that triangles (F,3,2) cover, the outer one first, simplified within a tenth of
    ``tolerance``; none where there are several regions. Holes and islands smaller than a hundredth of it are left
    out."""
    from manifold3d import CrossSection, FillRule

    region = CrossSection(list(np.ascontiguousarray(triangles)), FillRule.NonZero)
    outlines = [np.asarray(loop, dtype=np.float64) for loop in region.simplify(tolerance / 10).to_polygons()]
    areas = np.array([_measure_area(loop) for loop in outlines])
    kept = [k for k in np.argsort(-areas) if abs(areas[k]) > _SPECK * np.abs(areas).max()] if len(areas) else []
    return [outlines[k] for k in kept] if sum(areas[k] > 0 for k in kept) == 1 else []


def _measure_area(loop: Floats) -> float:
    """Signed area of a closed loop (K,2), positive where it runs counter-clockwise."""
    x, y = loop.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def _measure_deviation(points: Floats, surface: Surface, knots: tuple[Floats, Floats], poles: Floats) -> float:
    """The largest distance from the surface's vertices ``points`` (V,3) to the spline, or back from the spline where it
    is above or below the surface; in the coordinates of the plane."""

    def measure(queries: Floats, vertices: Floats, faces: Ints) -> Floats:
        return distance_to_mesh(queries, Mesh(vertices, faces))

    sides = [np.linspace(knot[0], knot[-1], _SAMPLES) for knot in knots]
    grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    sampled = np.column_stack([grid, NdBSpline(knots, poles[..., 2], DEGREE)(grid)])
    number = np.arange(len(sampled)).reshape(_SAMPLES, _SAMPLES)
    a, b, c, d = (x.reshape(-1) for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    there = measure(points, sampled, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])).max()
    flat, faces = points * [1, 1, 0], np.array(surface.faces)
    over = measure(sampled * [1, 1, 0], flat, faces) <= 1e-9 * surface.diagonal
    return float(max(there, measure(sampled[over], points, faces).max(initial=0.0)))
