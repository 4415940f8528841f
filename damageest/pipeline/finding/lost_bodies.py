"""Bodies of the part that are gone altogether: no inner damage surface is left of them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Evidence, Part, Solid
from damageest.geometry.bodies import label_pieces
from damageest.pipeline.state import FoundSite
from damageest.trust.skin.coverage import SkinView

BY_RAYS_ALONE = "rays"
"""The method of a site without scan points on it."""
SEEN = 0.02
"""Share of a body's skin that the scan may show though the body is gone: points of a body that it touched."""
PASSED = 0.1
"""Share of a body's skin that rays have to have passed through."""


def add_lost_bodies(part: Part, skin: SkinView, found: tuple[FoundSite, ...]) -> tuple[FoundSite, ...]:
    """Makes a site of each connected body of the part of which the scan shows nothing, and through which rays of the
    scanner passed."""
    if skin.rays is None or not skin.rays.lost.any():
        return found
    piece = label_pieces(part.faces)
    if piece.max() == 0:
        return found
    cells, owner = skin.cells, piece[skin.cells.parent]
    total, seen, passed = (
        np.bincount(owner, weights=cells.areas * chosen)
        for chosen in (np.ones(len(owner)), skin.perhaps_seen, skin.rays.lost & ~skin.perhaps_seen)
    )
    lost = []
    for number in np.flatnonzero((seen < SEEN * total) & (passed > PASSED * total)):
        used, renumbered = np.unique(part.faces[piece == number], return_inverse=True)
        try:
            body = Solid(part.vertices[used], renumbered.reshape(-1, 3))
        except ValueError:  # a cavity
            continue
        low, high = body.bounds
        if any((site.damage.bounds[0] < high).all() and (site.damage.bounds[1] > low).all() for site in found):
            continue
        lost.append(FoundSite(method=BY_RAYS_ALONE, evidence=Evidence()).with_value(FoundSite.damage, body))
    return (*found, *lost)
