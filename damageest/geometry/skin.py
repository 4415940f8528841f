"""The faces of a damage volume on the skin of the part (its nominal surface), and those inside the part."""

from __future__ import annotations

from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np

from damageest.artefacts import Flags, Mesh, Part, Solid, Surface
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.duplicates import list_used

ON_SKIN = 1e-7
"""Distance, in diagonals of the part, up to which a point lies on its skin."""
CLEARLY_OFF = 1e-5
"""Distance, in diagonals of the part, from which a corner is clearly off the skin."""
_FOUND: WeakKeyDictionary[Solid, tuple[ReferenceType[Part], Flags]] = WeakKeyDictionary()
"""What was found before: evidence, uncertainty and result ask it of the same solids."""
_TAKEN: WeakKeyDictionary[Solid, dict[bool, tuple[Flags, Mesh]]] = WeakKeyDictionary()
"""The faces inside the part, and the others, with what tells them apart."""


def find_inner_faces(damage: Solid, part: Part) -> Flags:
    """Whether each face (F,) of a damage volume lies inside the part, and not on its skin.

    A face is on the skin if three points within it are at most `ON_SKIN` from it. Both solids are in
    the unit and frame of the part. The array is read-only.
    """
    known = _FOUND.get(damage)
    if known is not None and known[0]() is part:
        return known[1]
    # a face with a corner clearly off the skin is inside
    off = np.zeros(len(damage.vertices), bool)
    used = list_used(damage.faces)
    off[used] = distance_to_mesh(damage.vertices[used], part) > CLEARLY_OFF * part.diagonal
    inner = np.asarray(off[damage.faces].any(axis=1))
    # Three points within each other triangle, because a face inside the part may have all corners on the skin.
    weights = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
    open_ = np.flatnonzero(~inner)
    probes = np.einsum("pk,fkj->fpj", weights, damage.triangles[open_]).reshape(-1, 3)
    inner[open_] = distance_to_mesh(probes, part).reshape(-1, 3).max(axis=1) > ON_SKIN * part.diagonal
    inner.flags.writeable = False
    _FOUND[damage] = ref(part), inner
    return inner


def take_lost_skin(damage: Solid, inner: Flags) -> Mesh:
    """The skin that a damage volume removes, on its own vertices. ``inner`` (F,): as `find_inner_faces` gives it.

    It is the same mesh each time, so that what is prepared for it, as the tree of its triangles, is prepared once."""
    return _take(damage, inner, False)


def take_inner_surface(damage: Solid, inner: Flags) -> Mesh:
    """As `take_lost_skin`, for the faces of a damage volume inside the part."""
    return _take(damage, inner, True)


def _take(damage: Solid, inner: Flags, which: bool) -> Mesh:
    known = _TAKEN.setdefault(damage, {})
    if which not in known or known[which][0] is not inner:
        known[which] = inner, Mesh(damage.vertices, damage.faces[inner == which])
    return known[which][1]


def extract_ids(damage: Solid, part: Part) -> Surface:
    """The inner damage surface of a damage volume: its faces inside the part, with normals toward the lost metal.

    It has no faces where the damage volume has none inside the part. Both solids are in the unit and frame of the part.
    """
    faces = damage.faces[find_inner_faces(damage, part)][:, ::-1]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Surface(damage.vertices[used], renumbered.reshape(-1, 3))
