"""Solids with fewer triangles, whose surface and volume stay within measured limits."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Mesh, Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import concatenate_meshes, to_manifold, to_solid

_SAME_VOLUME = 1e-3
"""Share of a body's volume by which it may change."""
_SLIVERS = 2e-3
"""Share of the old surface that may be farther than the detail from the new one: thin flakes and spikes without volume,
as Booleans leave them, are removed."""


def simplify_within(solid: Solid, detail: float) -> Solid:
    """The solid with fewer triangles; its surface differs by at most ``detail``, its volume by at most 0.1 %.

    Every vertex of the new surface is within ``detail`` (a length) of the old surface, and the old surface is within it
    of the new one, except 0.2 % of its area. This is measured for each body and each cavity; one that cannot be
    simplified within these limits stays as it is. Bodies without measurable volume are dropped. Unit and frame stay.
    """
    pieces: list[Mesh] = []
    for outer, cavities in split_shells(solid):
        pieces.append(_simplify_shell(outer, detail))
        for cavity in cavities:
            less = _simplify_shell(cavity, detail)
            pieces.append(Mesh(less.vertices, less.faces[:, ::-1]))
    if not pieces:
        return solid
    vertices, faces, _ = concatenate_meshes(pieces)
    return Solid(vertices, faces)


def _simplify_shell(body: Solid, detail: float) -> Solid:
    """One shell simplified as far as the limits allow; the same where no attempt keeps them."""
    area = np.linalg.norm(body.cross, axis=1)
    origin = body.bounds.mean(0)
    for share in (0.5, 0.2, 0.05):
        try:
            less = to_solid(to_manifold(body, origin).simplify(share * detail), origin)
        except ValueError:
            return body
        if less is None or len(less.faces) >= len(body.faces):
            continue
        lost = area[(distance_to_mesh(body.vertices, less) > detail)[body.faces].any(axis=1)].sum() / area.sum()
        same = abs(less.volume / body.volume - 1) <= _SAME_VOLUME
        if same and lost <= _SLIVERS and distance_to_mesh(less.vertices, body).max() <= detail:
            return less
    return body
