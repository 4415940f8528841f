"""Solids with fewer triangles, whose surface and volume stay within measured limits."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Mesh, Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import concatenate_meshes, to_manifold, to_solid

_SAME_VOLUME = 1e-3
"""Share of a body's volume by which it may change."""
_NO_VOLUME = 1e-4
"""Share of a body's volume by which it may change where flakes are removed."""
_SLIVERS = 2e-3
"""Share of the old surface that may be farther than the detail from the new one: thin flakes and spikes without volume,
as Booleans leave them, are removed."""
_SHARES = (0.7, 0.5, 0.35, 0.25, 0.17, 0.12, 0.05)
"""Shares of the detail that are tried in turn: manifold3d bounds each collapse of an edge, not their sum."""
_PROBES = np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8], [1 / 3, 1 / 3, 1 / 3]])
"""Places in a triangle at which it is measured how much of it is lost: a spike at a corner of a large one is little."""


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
    body = _remove_flakes(body, detail)
    area = 2 * body.face_areas
    origin = body.bounds.mean(0)
    for share in _SHARES:
        try:
            less = to_solid(to_manifold(body, origin).simplify(share * detail), origin)
        except ValueError:
            return body
        if less is None or len(less.faces) >= len(body.faces):
            continue
        far = np.flatnonzero((distance_to_mesh(body.vertices, less) > detail)[body.faces].any(axis=1))
        probes = np.einsum("pk,fkj->fpj", _PROBES, body.triangles[far]).reshape(-1, 3)
        share_far = (distance_to_mesh(probes, less) > detail).reshape(-1, len(_PROBES)).mean(axis=1)
        lost = (area[far] * share_far).sum() / area.sum()
        same = abs(less.volume / body.volume - 1) <= _SAME_VOLUME
        if same and lost <= _SLIVERS and distance_to_mesh(less.vertices, body).max() <= detail:
            return less
    return body


def _remove_flakes(body: Solid, detail: float) -> Solid:
    """The shell without sheets that are thinner than a hundredth of ``detail`` and have no volume."""
    origin = body.bounds.mean(0)
    try:
        less = to_solid(to_manifold(body, origin).simplify(0.01 * detail), origin)
    except ValueError:
        return body
    if less is None or len(less.faces) == len(body.faces) or abs(less.volume / body.volume - 1) > _NO_VOLUME:
        return body
    return less
