"""Boolean operations with a check of volumes: where manifold3d loses volume at coincident faces, another way is
tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid

SLACK = 1e-5
"""Largest accepted change of a solid's volume, as a share of it; a tenth of what the check of a deposit accepts."""
SAME = 5e-7
"""Distance, as a share of the largest coordinate, within which single precision makes two points one."""
DUST = 1e-9
"""Share of the stock's volume below which a piece of it is a rounding error."""


def simplify_exactly(body: Any, diagonal: float) -> Any:
    """A Manifold without vertices and edges that do not change its shape.

    Returned unchanged where this would change its volume: in rare cases manifold3d also removes a facet.
    """
    simple = body.as_original().simplify(1e-9 * diagonal)
    return simple if abs(simple.volume() - body.volume()) <= SLACK * abs(body.volume()) else body


def keep_touching(stock: Any, filled: Any, tolerance: float) -> Any:
    """The pieces of ``stock`` that touch the cavity ``filled``; others, cut off by a thin wall, are dropped, and
    so are rounding errors of the Boolean operation."""
    from manifold3d import Manifold

    least = DUST * stock.volume()
    pieces = [piece for piece in stock.decompose() if abs(piece.volume()) > least]
    if len(pieces) > 1:  # a cavity has a negative volume and belongs to the piece around it
        pieces = [p for p in pieces if p.volume() < 0 or p.min_gap(filled, tolerance) <= 1e-3 * tolerance]
    return Manifold.compose(pieces) if pieces else Manifold()


def join(filled: Any, stock: Any) -> Any:
    """The union of cavity and stock: the first of several ways whose volume adds up, else the one nearest to that."""
    expected = filled.volume() + stock.volume() - (filled ^ stock).volume()
    nudge = 1e-9 * max(abs(bound) for bound in filled.bounding_box())
    ways: tuple[Callable[[], Any], ...] = (
        lambda: filled + stock,
        lambda: filled + (stock - (stock ^ filled)),
        lambda: filled + stock.translate((nudge, 0.7 * nudge, -0.3 * nudge)),
    )
    tried: list[tuple[float, Any]] = []
    for way in ways:
        body = way()
        tried.append((abs(expected - body.volume()), body))
        if tried[-1][0] <= SLACK * expected:
            break
    return min(tried, key=lambda item: item[0])[1]


def separate_sheets(body: Any, origin: Floats, by: float) -> Solid | None:
    """A Manifold as a Solid that stays closed when a reader merges vertices at one place, in single precision too.

    A Boolean operation may leave lines along which two sheets touch, each with its own vertices. Merged, the edges
    there have four triangles. Such vertices are moved inward by ``by``; where that is not enough, finer details are
    removed first. None where the Manifold is empty; not changed where nothing helps.
    """
    from damageest.geometry.rounding import round_to_single
    from damageest.geometry.solids import to_solid

    first = to_solid(body, origin)
    for detail in (0.0, 0.01, 0.1, 1.0):
        simple = body.simplify(detail * by) if detail else body
        if abs(simple.volume() - body.volume()) > SLACK * abs(body.volume()):
            continue
        tried = to_solid(simple, origin)
        for _ in range(3):
            if tried is None:
                break
            if round_to_single(tried, mend=False) is not None:
                return tried
            tried = _move_inward(tried, by)
    return first


def _move_inward(body: Solid, by: float) -> Solid | None:
    """The solid with coincident vertices moved inward by ``by``; None where the result is not a solid."""
    from scipy.spatial import cKDTree

    points = body.vertices
    pairs = cKDTree(points).query_pairs(SAME * float(np.abs(points).max()), output_type="ndarray")
    coincident = np.unique(pairs)
    moved = points.copy()
    moved[coincident] -= by * body.vertex_normals[coincident]
    try:
        return Solid(moved, body.faces)
    except ValueError:
        return None
