"""The connected bodies of a solid, and the outer shell and cavities of each."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import ArtefactError, Floats, Ints, Solid
from damageest.geometry.distance import is_inside

ROUNDING = 1e-9
"""Thickness of a piece, twice its volume over its area, in diagonals of the solid, below which it has no volume."""


def split_bodies(solid: Solid) -> list[Solid]:
    """The connected bodies of a solid, in the order of their first vertices.

    Two triangles belong to one body if they are connected by shared vertices. Bodies whose volume is zero within
    rounding are left out. A cavity shares no vertex with the shell around it and has negative volume: it is left out
    too, so the volume of a hollow body counts the cavity. Use `split_shells` where cavities matter.

    Gives the same bodies as manifold3d's ``decompose``, whose time grows with the number of bodies times the number
    of faces. Unit and frame are those of ``solid``.
    """
    pieces = _split_pieces(solid)
    if len(pieces) == 1:
        return [solid]
    found = []
    for vertices, faces in pieces:
        body = _take_body(vertices, faces, solid.diagonal)
        if body is not None:
            found.append(body)
    return found


def split_shells(solid: Solid) -> list[tuple[Solid, list[Solid]]]:
    """The connected bodies of a solid: for each its outer shell, and the cavities inside it.

    Both are solids with faces outward, so the volume of a body is that of its shell minus those of its cavities. A
    cavity belongs to the smallest shell that encloses its first vertex. Shells and cavities whose volume is zero within
    rounding are left out. Unit and frame are those of ``solid``.
    """
    outer: list[Solid] = []
    cavities: list[Solid] = []
    for vertices, faces in _split_pieces(solid):
        for found, turned in ((outer, faces), (cavities, faces[:, ::-1])):
            body = _take_body(vertices, turned, solid.diagonal)
            if body is not None:
                found.append(body)
                break
    out: list[tuple[Solid, list[Solid]]] = [(body, []) for body in outer]
    for cavity in cavities:
        holding = [pair for pair in out if len(out) == 1 or is_inside(cavity.vertices[:1], pair[0])[0]]
        if holding:
            min(holding, key=lambda pair: pair[0].volume)[1].append(cavity)
    return out


def _take_body(vertices: Floats, faces: Ints, diagonal: float) -> Solid | None:
    """A piece as a solid; None where it faces the other way, or is flat within rounding."""
    try:
        body = Solid(vertices, faces)
    except ArtefactError:
        return None
    area = body.area
    return body if 2 * body.volume > ROUNDING * diagonal * area else None


def label_pieces(faces: Ints) -> Ints:
    """(F,) the number, from 0, of the piece that each face belongs to, in the order of their first vertices.

    Faces that share a vertex are in one piece.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = int(faces.max(initial=-1)) + 1
    links = coo_array((np.ones(2 * len(faces)), np.concatenate([faces[:, :2], faces[:, 1:]]).T), shape=(size, size))
    label = connected_components(links, directed=False)[1][faces[:, 0]]
    return np.unique(label, return_inverse=True)[1].astype(np.int64)  # vertices without a face have numbers too


def _split_pieces(solid: Solid) -> list[tuple[Floats, Ints]]:
    """Vertices (V,3) and faces (F,3) of each piece that shares no vertex with another, in the order of their first
    vertices."""
    faces = solid.faces
    of_face = label_pieces(faces)
    order = np.argsort(of_face, kind="stable")
    pieces = []
    for own in np.split(order, np.flatnonzero(np.diff(of_face[order])) + 1):
        used, renumbered = np.unique(faces[own], return_inverse=True)
        pieces.append((solid.vertices[used], renumbered.reshape(-1, 3)))
    return pieces
