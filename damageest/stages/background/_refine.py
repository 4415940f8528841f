"""Subdivision of a background to a given edge, and the check that it holds what it has to."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Solid, Surface
from damageest.errors import StageError
from damageest.solids import to_solid

MOST_FACES = 400_000


def refined(body: Any, edge: float, origin: Floats) -> Solid:
    """A Manifold with no edge longer than ``edge``, or than what some 400,000 triangles allow."""
    least = float(np.sqrt(4 * body.surface_area() / np.sqrt(3) / MOST_FACES * 2))
    solid = to_solid(body.refine_to_length(max(edge, least)), origin)
    if solid is None:
        raise StageError("the background came out empty", "background: bbox")
    return solid


def check_holds(background: Solid, part: Part, surface: Surface) -> Solid:
    """The background, if part and IDS lie inside it. Raises StageError otherwise."""
    import igl

    inner = np.concatenate([part.vertices, part.triangles.mean(axis=1), surface.vertices])
    origin = background.bounds.mean(axis=0)
    number = igl.fast_winding_number(
        np.ascontiguousarray(background.vertices - origin),
        np.array(background.faces),
        np.ascontiguousarray(inner - origin),
    )
    if outside := int((number < 0.5).sum()):
        raise StageError(
            f"the background does not hold part and damage surface: {outside} of {len(inner)} points lie outside",
            "background: bbox, or method: implicit",
        )
    return background
