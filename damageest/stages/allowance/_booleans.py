"""Boolean operations with a check of volumes: where manifold3d loses volume at coincident faces, another way is
tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from damageest.artefacts import Floats, Solid
from damageest.geometry.solids import compose_shells, to_manifold, to_solid

SLACK = 1e-5
"""Largest accepted change of a solid's volume, as a share of it; a tenth of what the check of a deposit accepts."""
TOUCHING = 1e-3
"""Tolerances between two bodies up to which they touch."""
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
    least = DUST * stock.volume()
    pieces = [piece for piece in stock.decompose() if abs(piece.volume()) > least]
    if len(pieces) > 1:  # a cavity has a negative volume and belongs to the piece around it
        pieces = [piece for piece in pieces if piece.volume() < 0 or touches(piece, filled, tolerance)]
    return compose_shells(pieces)


def touches(piece: Any, body: Any, tolerance: float) -> bool:
    """Whether two Manifolds touch, within `TOUCHING`."""
    return bool(piece.min_gap(body, tolerance) <= TOUCHING * tolerance)


def drop_crumbs(solid: Solid, origin: Floats, least: float) -> Solid:
    """A solid without the pieces, and the voids in it, of at most ``least`` in volume: rounding errors of a Boolean
    operation. Those that touch another piece at a vertex are pieces too, as they are to whoever reads its file."""
    pieces = to_manifold(solid, origin).decompose()
    kept = [piece for piece in pieces if abs(piece.volume()) > least]
    return solid if len(kept) == len(pieces) else to_solid(compose_shells(kept), origin) or solid


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
