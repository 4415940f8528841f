"""What is left of a part without lost solids that lie inside it and share its skin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part, Solid
from damageest.geometry.edges import list_edges
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import BALANCE, subtract_lost, to_manifold, to_solid, unite
from damageest.geometry.vectors import normalise

OPENED = 1e-4
"""Share of an opened cavity by which what its opening takes out of the part may differ from it."""
LIFT = 1e-7
"""By how much the outer faces of what is taken off are lifted off the skin, as a share of the part's diagonal."""


def subtract_from_part(
    part: Part, lost: Sequence[Solid], union: Any = None, openings: Sequence[Solid | None] = ()
) -> Solid | None:
    """The part without ``lost`` solids, which lie inside it; None where nothing is left, the part itself without any.

    All are in one frame and unit; ``union``: of ``lost``, as `unite` gives it about the middle of the part's bounds,
    where it is there already; ``openings``: for each of ``lost`` a solid that takes it out of the part and stands out
    of it, where there is one (`Deposit.opening`).

    The outer faces of a damage volume lie on the part's skin but for rounding. The plain difference leaves membranes
    without thickness there, over up to three quarters of an opening: no volume, but rays and other software see them.
    So these faces are lifted off the skin first, outwards; the inner damage surface and the rim stay as they are.

    Raises ValueError where manifold3d rejects one of the solids.
    """
    if not lost:
        return part
    origin = part.bounds.mean(axis=0)
    whole = to_manifold(part, origin)
    plain = unite(lost, origin) if union is None else union
    known = openings or [None] * len(lost)
    taken = [
        lift_faces(one, ~find_inner_faces(one, part), LIFT * part.diagonal) if opening is None else opening
        for one, opening in zip(lost, known, strict=True)
    ]
    left = whole - unite(taken, origin)
    # a cavity and what opens it are two results of Boolean operations, each with rounding errors of its own
    opened = sum(one.volume for one, opening in zip(lost, known, strict=True) if opening is not None)
    room = BALANCE * whole.volume() + OPENED * opened
    if abs(whole.volume() - plain.volume() - left.volume()) > room:
        left = subtract_lost(whole, plain)
    return to_solid(left, origin)


def lift_faces(mesh: Mesh, lifted: Flags, height: float) -> Mesh:
    """A closed mesh whose ``lifted`` faces (F,) stand off by ``height``, outwards, but for the border to the others.

    Each is divided about its centre and the middles of its edges to other lifted faces; these places, and vertices
    that lifted faces alone have, are moved along the mean of their normals.
    """
    faces, rest = mesh.faces[lifted], mesh.faces[~lifted]
    if not len(faces):
        return mesh
    normals = normalise(mesh.cross[lifted])
    vertices = mesh.vertices.copy()
    free = np.zeros(len(vertices), bool)
    free[faces] = True
    free[rest] = False
    vertices[free] += height * _average(faces, normals, len(vertices))[free]
    centres = mesh.vertices[faces].mean(axis=1) + height * normals
    middles, number = _find_middles(mesh.vertices, faces, normals, height)
    at_centre = len(vertices) + np.arange(len(faces))
    at_middle = np.where(number >= 0, len(vertices) + len(faces) + number, -1)
    made: list[Ints] = []
    for k in range(3):
        first, last, middle = faces[:, k], faces[:, (k + 1) % 3], at_middle[:, k]
        cut = middle >= 0
        made.append(np.stack([first, np.where(cut, middle, last), at_centre], axis=1))
        made.append(np.stack([middle, last, at_centre], axis=1)[cut])
    return Mesh(np.concatenate([vertices, centres, middles]), np.concatenate([rest, *made]))


def _average(faces: Ints, normals: Floats, count: int) -> Floats:
    """Mean of the normals (F,3) of the faces (F,3) at each of ``count`` vertices, of length one, or zero."""
    total = np.zeros((count, 3))
    for k in range(3):
        np.add.at(total, faces[:, k], normals)
    return normalise(total)


def _find_middles(vertices: Floats, faces: Ints, normals: Floats, height: float) -> tuple[Floats, Ints]:
    """The middles (M,3), moved out, of edges that two of the faces (F,3) share, and which of them each edge of a face
    has (F,3), -1 for none."""
    edges = list_edges(faces)
    pairs, number, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    number = number.reshape(-1)
    shared = count == 2
    place = np.where(shared, np.cumsum(shared) - 1, -1)
    out = np.zeros((len(pairs), 3))
    np.add.at(out, number, np.repeat(normals, 3, axis=0))
    middles = vertices[pairs[shared]].mean(axis=1) + height * normalise(out[shared])
    return middles, place[number].reshape(-1, 3)
