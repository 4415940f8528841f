"""The connected bodies of a solid, and the shells of which each is made."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import ArtefactError, Floats, Ints, Solid
from damageest.geometry.distance import is_inside


def split_bodies(solid: Solid) -> list[Solid]:
    """The connected bodies of a solid, by their shared vertices; those without measurable volume are left out.

    As manifold3d's ``decompose``, whose time grows with the number of bodies times that of the faces. A cavity, whose
    faces are connected to no others, has negative volume and is left out too: see `split_shells`.
    """
    pieces = _split(solid)
    if len(pieces) == 1:
        return [solid]
    found = []
    for vertices, faces in pieces:
        try:
            found.append(Solid(vertices, faces))
        except ArtefactError:  # a sliver whose volume rounding takes away
            continue
    return found


def split_shells(solid: Solid) -> list[tuple[Solid, list[Solid]]]:
    """Each connected body as its outer shell, and the cavities in it as solids of their own."""
    outer: list[Solid] = []
    cavities: list[Solid] = []
    for vertices, faces in _split(solid):
        for found, turned in ((outer, faces), (cavities, faces[:, ::-1])):
            try:
                found.append(Solid(vertices, turned))
                break
            except ArtefactError:  # inside out, or flat: neither
                continue
    out: list[tuple[Solid, list[Solid]]] = [(body, []) for body in outer]
    for cavity in cavities:
        holding = [pair for pair in out if len(out) == 1 or is_inside(cavity.vertices[:1], pair[0])[0]]
        if holding:
            min(holding, key=lambda pair: pair[0].volume)[1].append(cavity)
    return out


def _split(solid: Solid) -> list[tuple[Floats, Ints]]:
    """Vertices and faces of each piece that no vertex joins to another, in the order of their first vertices."""
    size, faces = len(solid.vertices), solid.faces
    links = coo_array((np.ones(2 * len(faces)), np.concatenate([faces[:, :2], faces[:, 1:]]).T), shape=(size, size))
    of_face = connected_components(links, directed=False)[1][faces[:, 0]]
    order = np.argsort(of_face, kind="stable")
    pieces = []
    for own in np.split(order, np.flatnonzero(np.diff(of_face[order])) + 1):
        used, renumbered = np.unique(faces[own], return_inverse=True)
        pieces.append((solid.vertices[used], renumbered.reshape(-1, 3)))
    return pieces
