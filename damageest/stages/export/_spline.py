"""Fits a B-spline to an inner damage surface that is a height field over a plane: one smooth face for CAM."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, NdBSpline
from scipy.sparse import csr_array, eye_array, kron
from scipy.sparse.linalg import spsolve

from damageest.artefacts import Floats, Ints, Mesh, Surface
from damageest.geometry.distance import distance_to_mesh
from damageest.stages.export import Patch, Spline

DEGREE = 3
_OVERHANG = 0.01
"""Largest share of the area that may overhang, as slivers do; the deviation there is measured all the same."""
_SPANS = (4, 8, 16, 32, 64)
_STIFF = 1e-4
"""Weight of the second differences of the poles, which fix the spline where the surface has no points."""
_SPECK = 0.01
_MARGIN = 0.03
_SAMPLES = 400


def fit_spline(surface: Surface, tolerance: float) -> tuple[Patch | None, Spline]:
    """The coarsest spline within half of ``tolerance`` of the surface, else the one with the smallest deviation.

    Its parameters are lengths in the plane over which the surface is a height field.

    Returns:
        The spline, None where none is within the tolerance; and its deviation, or the reason why there is none.
    """
    axes, overhang = _fit_plane(surface)
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
        knots, poles = _solve_least_squares(data, spans)
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


def _fit_plane(surface: Surface) -> tuple[Floats, float]:
    """Fits a plane so that little of the surface faces away from its normal.

    Returns:
        (3,3) two directions in the plane and its normal; the share of the area that faces away.
    """
    area = np.linalg.norm(surface.cross, axis=1)
    unit = surface.cross / np.maximum(area, 1e-300)[:, None]
    weight, best, least = area / area.sum(), np.zeros(3), np.inf
    for _ in range(20):  # faces at a steep angle get more weight, so that the normal turns toward them
        normal = weight @ unit
        normal /= max(float(np.linalg.norm(normal)), 1e-300)
        away = area[unit @ normal < 0.02].sum() / area.sum()
        if away < least:
            best, least = normal, float(away)
        weight = weight * np.exp(-0.5 * (unit @ normal))
        weight /= weight.sum()
    spread = surface.vertices - surface.vertices.mean(axis=0)
    flat = spread - np.outer(spread @ best, best)
    first = np.linalg.svd(flat.T @ flat)[0][:, 0]  # along its length
    first -= best * (first @ best)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(best, first), best]), least


def _solve_least_squares(data: Floats, spans: int) -> tuple[tuple[Floats, Floats], Floats]:
    """Knots in both directions and poles (U,V,3) of the spline nearest to points (N,3), by least squares."""
    low, high = data[:, :2].min(axis=0), data[:, :2].max(axis=0)
    edge = _MARGIN * (high - low).max()
    long = (high - low).max()
    knots, basis, bend = [], [], []
    for k in range(2):
        count = max(2, round(spans * (high[k] - low[k]) / long))
        inner = np.linspace(low[k] - edge, high[k] + edge, count + 1)
        knots.append(np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])]))
        basis.append(csr_array(BSpline.design_matrix(data[:, k], knots[k], DEGREE)))
        size = len(knots[k]) - DEGREE - 1
        bend.append(csr_array(np.diff(np.eye(size), 2, axis=0)))
    sizes = [len(k) - DEGREE - 1 for k in knots]
    u, v = basis
    # at each point, DEGREE + 1 basis functions per direction are not 0: their products, row by row
    rows = np.repeat(np.arange(len(data)), (DEGREE + 1) ** 2)
    columns = (u.indices.reshape(-1, DEGREE + 1, 1) * sizes[1] + v.indices.reshape(-1, 1, DEGREE + 1)).reshape(-1)
    values = (u.data.reshape(-1, DEGREE + 1, 1) * v.data.reshape(-1, 1, DEGREE + 1)).reshape(-1)
    A = csr_array((values, (rows, columns)), shape=(len(data), sizes[0] * sizes[1]))
    stiff = kron(bend[0].T @ bend[0], eye_array(sizes[1])) + kron(eye_array(sizes[0]), bend[1].T @ bend[1])
    heights = spsolve((A.T @ A + _STIFF * len(data) / A.shape[1] * stiff).tocsc(), A.T @ data[:, 2])
    # poles at the means of their knots (Greville points) reproduce the parameters as coordinates
    at = [np.convolve(k[1:-1], np.full(DEGREE, 1 / DEGREE), "valid") for k in knots]
    poles = np.dstack([*np.meshgrid(*at, indexing="ij"), np.asarray(heights).reshape(sizes)])
    return (knots[0], knots[1]), poles


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
