"""B-splines over a plane, fitted to a surface that is a height field over it."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, eye_array, kron
from scipy.sparse.linalg import spsolve

from damageest.artefacts import Floats, Mesh

DEGREE = 3
_STIFF = 1e-4
"""Weight of the second differences of the poles, which fix the spline where the surface has no points."""
_MARGIN = 0.03


def fit_height_plane(surface: Mesh) -> tuple[Floats, float]:
    """Fits a plane so that little of the surface faces away from its normal.

    Returns:
        (3,3) two directions in the plane and its normal; the share of the area that faces away.

    Raises ValueError where the surface has no area.
    """
    area = 2 * surface.face_areas
    if not area.sum() > 0:
        raise ValueError(f"no plane for a surface without area ({len(area)} triangles)")
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


def fit_height_spline(data: Floats, spans: int, margin: float = _MARGIN) -> tuple[tuple[Floats, Floats], Floats]:
    """Knots in both directions and poles (U,V,3) of the height spline nearest to points (N,3), by least squares.

    Its parameters are x and y. ``spans``: of the longer side. It ends ``margin`` of that side beyond the points. Raises
    ValueError where the points have fewer than two places over the plane.
    """
    knots, heights = fit_parametric_spline(data[:, :2], data[:, 2:], spans, margin)
    poles = np.dstack([*np.meshgrid(*map(_place_poles, knots), indexing="ij"), heights])
    return knots, poles


def fit_parametric_spline(
    uv: Floats, values: Floats, spans: int, margin: float = _MARGIN
) -> tuple[tuple[Floats, Floats], Floats]:
    """Knots in both directions and poles (U,V,K) of the spline nearest to values (N,K) at parameters (N,2).

    By least squares. ``spans``: of the longer side. It ends ``margin`` of that side beyond the parameters, and goes on
    as straight as possible where there are no points. Raises ValueError where there are fewer than two different
    parameters.
    """
    if not len(uv) or not np.ptp(uv, axis=0).any():
        raise ValueError(f"no spline for {len(uv)} points at fewer than two places")
    low, high = uv.min(axis=0), uv.max(axis=0)
    edge = margin * (high - low).max()
    long = (high - low).max()
    knots, basis, bend = [], [], []
    for k in range(2):
        count = max(2, round(spans * (high[k] - low[k]) / long))
        inner = np.linspace(low[k] - edge, high[k] + edge, count + 1)
        knots.append(np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])]))
        basis.append(csr_array(BSpline.design_matrix(uv[:, k], knots[k], DEGREE)))
        bend.append(csr_array(_differ_twice(_place_poles(knots[k]))))
    sizes = [len(k) - DEGREE - 1 for k in knots]
    u, v = basis
    # at each point, DEGREE + 1 basis functions per direction are not 0: their products, row by row
    rows = np.repeat(np.arange(len(uv)), (DEGREE + 1) ** 2)
    columns = (u.indices.reshape(-1, DEGREE + 1, 1) * sizes[1] + v.indices.reshape(-1, 1, DEGREE + 1)).reshape(-1)
    weights = (u.data.reshape(-1, DEGREE + 1, 1) * v.data.reshape(-1, 1, DEGREE + 1)).reshape(-1)
    A = csr_array((weights, (rows, columns)), shape=(len(uv), sizes[0] * sizes[1]))
    stiff = kron(bend[0].T @ bend[0], eye_array(sizes[1])) + kron(eye_array(sizes[0]), bend[1].T @ bend[1])
    found = spsolve((A.T @ A + _STIFF * len(uv) / A.shape[1] * stiff).tocsc(), A.T @ values)
    return (knots[0], knots[1]), np.asarray(found).reshape(*sizes, values.shape[1])


def _place_poles(knots: Floats) -> Floats:
    """The means of each pole's knots (Greville points): poles there reproduce the parameters as coordinates."""
    return np.asarray(np.convolve(knots[1:-1], np.full(DEGREE, 1 / DEGREE), "valid"))


def _differ_twice(at: Floats) -> Floats:
    """(N-2,N) second differences of values at places (N,), 0 for a straight line, also where places are not even."""
    before, after = np.diff(at)[:-1], np.diff(at)[1:]
    rows = np.zeros((len(at) - 2, len(at)))
    k = np.arange(len(rows))
    rows[k, k], rows[k, k + 2] = 2 * after / (before + after), 2 * before / (before + after)
    rows[k, k + 1] = -2.0
    return rows
