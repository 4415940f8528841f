"""Unrolls a curved surface into a plane, so that patterns can be drawn there and put back on the surface.

By the local/global method of "as rigid as possible" maps (Liu et al. 2008). A cylinder or a cone is unrolled without
stretching it; a bowl is not, so the plane is scaled until no length on the surface is longer than in the plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats, Ints

ROUNDS = 40
CLOSE = 1e-4
"""Change of a round, in mean edges, at which the map is good enough."""


class Unrolled(NamedTuple):
    """``places`` (V,2) in the plane; ``stretch`` (F,2): the larger and the smaller ratio of lengths on the surface to
    those in the plane in each face, the smaller negative where the face is turned over."""

    places: Floats
    stretch: Floats


def unroll(vertices: Floats, faces: Ints) -> Unrolled:
    """Unrolls a connected surface that is a graph over the plane of x and y: vertices (V,3), faces (F,3) seen
    anticlockwise. Directions in the plane are near to those of x and y. Lengths are not scaled yet."""
    flat = _lay_flat(vertices[faces])
    places = vertices[:, :2] - vertices[:, :2].mean(axis=0)
    stretch = measure_stretch(places, faces, flat)
    if np.abs(stretch - 1).max(initial=0.0) > 1e-6:
        places = _relax(places, faces, flat)
        stretch = measure_stretch(places, faces, flat)
    else:
        places = vertices[:, :2].copy()
    return Unrolled(places, stretch)


def _lay_flat(triangles: Floats) -> Floats:
    """The corners (F,3,2) of triangles (F,3,3) in the plane of each."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    along = b - a
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, 1e-300)[:, None]
    x = np.einsum("fi,fi->f", c - a, along)
    y = np.linalg.norm(c - a - x[:, None] * along, axis=1)
    zero = np.zeros(len(a))
    return np.stack([np.stack([zero, zero], 1), np.stack([length, zero], 1), np.stack([x, y], 1)], axis=1)


def _relax(places: Floats, faces: Ints, flat: Floats) -> Floats:
    """Places (V,2) where each face is as near to its true shape as its neighbours permit."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu

    count = len(places)
    size = float(np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1).mean())
    start, stop = faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
    sides = flat[:, [1, 2, 0]] - flat[:, [2, 0, 1]]  # opposite of each corner
    first, second = flat[:, [1, 2, 0]] - flat, flat[:, [2, 0, 1]] - flat
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    weight = np.maximum((first * second).sum(axis=2) / np.maximum(cross, 1e-12 * size**2), 1e-3) / 2
    rows = np.concatenate([start.ravel(), stop.ravel(), start.ravel(), stop.ravel()])
    columns = np.concatenate([stop.ravel(), start.ravel(), start.ravel(), stop.ravel()])
    values = np.concatenate([-weight.ravel(), -weight.ravel(), weight.ravel(), weight.ravel()])
    matrix = coo_matrix((values, (rows, columns)), (count, count)).tocsc()
    solver = splu(
        matrix[1:, 1:].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
    )
    origin = places.copy()
    x, y = weight * sides[..., 0], weight * sides[..., 1]
    begin, end = start.ravel(), stop.ravel()
    for _ in range(ROUNDS):
        across, up = places[start, 0] - places[stop, 0], places[start, 1] - places[stop, 1]
        c, s = (across * x + up * y).sum(axis=1), (up * x - across * y).sum(axis=1)
        length = np.hypot(c, s)
        c = np.divide(c, length, out=np.ones_like(c), where=length > 0)[:, None]
        s = np.divide(s, length, out=np.zeros_like(s), where=length > 0)[:, None]
        right = np.empty((count, 2))
        for k, pull in enumerate((c * x - s * y, s * x + c * y)):
            right[:, k] = np.bincount(begin, pull.ravel(), count) - np.bincount(end, pull.ravel(), count)
        fresh = np.concatenate([np.zeros((1, 2)), solver.solve(right[1:])])
        fresh += places.mean(axis=0) - fresh.mean(axis=0)
        change = float(np.abs(fresh - places).max())
        places = fresh
        if change < CLOSE * size:
            break
    return _align(places, origin)


def _align(places: Floats, origin: Floats) -> Floats:
    """The places (V,2), turned so that they lie as the original ones do."""
    away, was = places - places.mean(axis=0), origin - origin.mean(axis=0)
    spin = was.T @ away
    angle = np.arctan2(spin[0, 1] - spin[1, 0], spin[0, 0] + spin[1, 1])
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(away @ np.array([[c, -s], [s, c]]))


def measure_stretch(places: Floats, faces: Ints, flat: Floats) -> Floats:
    """The ratios (F,2) of lengths on the surface to those in the plane; see `Unrolled`."""
    shown = places[faces]
    u, v = shown[:, 1] - shown[:, 0], shown[:, 2] - shown[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    area = np.where(np.abs(area) < 1e-300, 1e-300, area)
    inverse = (
        np.stack([np.stack([v[:, 1], -v[:, 0]], 1), np.stack([-u[:, 1], u[:, 0]], 1)], axis=1) / area[:, None, None]
    )
    edges = np.stack([flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]], axis=2)
    map_ = edges @ inverse
    a, b, c, d = map_[:, 0, 0], map_[:, 0, 1], map_[:, 1, 0], map_[:, 1, 1]
    plus, minus = np.hypot(a + d, c - b), np.hypot(a - d, b + c)
    return np.stack([(plus + minus) / 2, (plus - minus) / 2], axis=1)
