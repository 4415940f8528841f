"""Booleans whose volumes are balanced: what manifold3d loses where faces coincide is noticed, and done another way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid

SLACK = 1e-5
"""Share of a solid's volume by which it may change without a word; a tenth of what the check of a deposit bears."""
SAME = 5e-7
"""Distance, in the largest coordinate, within which a reader in single precision takes two points for one."""
DUST = 1e-9
"""Share of the stock's volume below which a piece of it is rounding."""


def simplify_exactly(body: Any, diagonal: float) -> Any:
    """A Manifold without what it needs not to have its shape. As it was, where that would change its volume: manifold3d
    was seen to take a facet along."""
    simple = body.as_original().simplify(1e-9 * diagonal)
    return simple if abs(simple.volume() - body.volume()) <= SLACK * abs(body.volume()) else body


def keep_touching(proud: Any, filled: Any, tolerance: float) -> Any:
    """Without the pieces of stock that do not touch what is filled, as behind a thin wall that cuts them off, and
    without the dust of the Boolean."""
    from manifold3d import Manifold

    least = DUST * proud.volume()
    pieces = [piece for piece in proud.decompose() if abs(piece.volume()) > least]
    if len(pieces) > 1:  # a void has a negative volume, and belongs to the piece round it
        pieces = [p for p in pieces if p.volume() < 0 or p.min_gap(filled, tolerance) <= 1e-3 * tolerance]
    return Manifold.compose(pieces) if pieces else Manifold()


def join(filled: Any, proud: Any) -> Any:
    """The union, by the first of several ways that leaves no volume unaccounted for, else the nearest; as
    `damageest.geometry.solids.remainder`."""
    whole = filled.volume() + proud.volume() - (filled ^ proud).volume()
    nudge = 1e-9 * max(abs(bound) for bound in filled.bounding_box())
    ways: tuple[Callable[[], Any], ...] = (
        lambda: filled + proud,
        lambda: filled + (proud - (proud ^ filled)),
        lambda: filled + proud.translate((nudge, 0.7 * nudge, -0.3 * nudge)),
    )
    tried: list[tuple[float, Any]] = []
    for way in ways:
        body = way()
        tried.append((abs(whole - body.volume()), body))
        if tried[-1][0] <= SLACK * whole:
            break
    return min(tried, key=lambda item: item[0])[1]


def separate_sheets(body: Any, origin: Floats, by: float) -> Solid | None:
    """A Manifold as a Solid that closes for readers who know vertices by their place alone, in single precision too.

    A Boolean may leave lines along which sheets touch, each with vertices of its own; merged, their edges have four
    triangles. Such vertices are drawn in by ``by``, and where details finer than that are in the way, those go first.
    None where the Manifold is empty; as it was where nothing helps.
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
    """The solid with those vertices drawn in that stand where another stands; None where it is none any more."""
    from scipy.spatial import cKDTree

    points = body.vertices
    pairs = cKDTree(points).query_pairs(SAME * float(np.abs(points).max()), output_type="ndarray")
    alike = np.unique(pairs)
    moved = points.copy()
    moved[alike] -= by * body.vertex_normals[alike]
    try:
        return Solid(moved, body.faces)
    except ValueError:
        return None
