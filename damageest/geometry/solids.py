"""Solids to manifold3d and back, in float64, and Booleans of solids.

A ``manifold3d.Manifold`` (typed Any) has its coordinates relative to an ``origin`` of the caller's choice. Choose one
near the solid: far from the origin, Booleans lose digits. Bodies of one Boolean need the same origin, unit and frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Floats, Ints, Mesh, Part, Solid

_last: WeakKeyDictionary[Mesh, tuple[Floats, Any]] = WeakKeyDictionary()
"""The last part, with the origin of its Manifold and this; one alone, as large parts take much memory."""

BALANCE = 1e-7
"""Share of a solid's volume within which the volumes cut off and left have to add up to it."""


def to_manifold(mesh: Mesh, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """A ``manifold3d.Manifold`` of a watertight mesh, its coordinates relative to ``origin`` (3,); an empty one of a
    mesh without triangles. That of the last part is kept: each site asks for it.

    Raises ValueError where manifold3d rejects the mesh because it is not closed, or its windings are not consistent.
    """
    from manifold3d import Error, Manifold, Mesh64

    if not len(mesh.faces):
        return Manifold()
    about = np.asarray(origin, dtype=np.float64)
    if isinstance(mesh, Part) and (known := _last.get(mesh)) is not None and np.array_equal(known[0], about):
        return known[1]
    vertices = np.array(mesh.vertices - about, dtype=np.float64, order="C")
    body = Manifold(Mesh64(vertices, np.array(mesh.faces, dtype=np.uint64, order="C")))
    if body.status() != Error.NoError:
        raise ValueError(f"manifold3d rejects the mesh: {body.status().name}")
    if isinstance(mesh, Part):
        _last.clear()
        _last[mesh] = about, body
    return body


def to_arrays(body: Any, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) of a Manifold; ``origin`` (3,) is added to the vertices."""
    mesh = body.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3] + np.asarray(origin, dtype=np.float64)
    return vertices, np.asarray(mesh.tri_verts).astype(np.int64)


def to_solid(body: Any, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Solid | None:
    """A Manifold as a Solid, with ``origin`` (3,) added to the vertices.

    None where the Manifold is empty, or has no volume within rounding.
    """
    if body.is_empty():
        return None
    vertices, faces = to_arrays(body, origin)
    try:
        return Solid(vertices, faces)
    except ValueError:
        return None


def compose_shells(shells: Sequence[Any]) -> Any:
    """Shells as ``decompose`` gives them, with cavities of negative volume, as one Manifold; empty without any.

    ``Manifold.compose`` fills the cavities.
    """
    from manifold3d import Manifold, Mesh64

    body = Manifold.compose([shell for shell in shells if shell.volume() > 0])
    for cavity in (shell for shell in shells if shell.volume() < 0):
        mesh = cavity.to_mesh64()
        turned = np.array(np.asarray(mesh.tri_verts)[:, ::-1], order="C")
        body -= Manifold(Mesh64(np.array(mesh.vert_properties), turned))
    return body


def concatenate_meshes(meshes: Sequence[Mesh]) -> tuple[Floats, Ints, Ints]:
    """Several meshes as one: vertices (V,3), faces (F,3), and the index (F,) of the mesh that each face came from.

    Equal vertices of two meshes are not merged.
    """
    if not meshes:
        return np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty(0, np.int64)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    return vertices, faces, owner


def unite(solids: Iterable[Mesh], origin: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """The union of watertight meshes as a Manifold, relative to ``origin`` (3,); empty without any.

    Raises ValueError where manifold3d rejects one of them.
    """
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean([to_manifold(solid, origin) for solid in solids] or [Manifold()], OpType.Add)


def subtract_lost(whole: Any, lost: Any) -> Any:
    """``whole`` minus ``lost``, which lies inside it: three Manifolds with one origin.

    Where faces of the two coincide, for example the outer faces of a damage volume with those of the part, manifold3d
    3.5 can give a wrong difference without an error (one was an eighth too small). So the volumes are checked: the
    difference is computed in up to three ways, and the first is taken that with ``lost`` adds up to the volume of
    ``whole`` within BALANCE; if none does, the one with the smallest error.
    """
    nudge = 1e-9 * max(abs(bound) for bound in whole.bounding_box())
    ways: tuple[Callable[[], Any], ...] = (
        lambda: whole - lost,
        lambda: whole - (whole ^ lost),
        lambda: whole - lost.translate((nudge, 0.7 * nudge, -0.3 * nudge)),
    )
    tried: list[tuple[float, Any]] = []
    for way in ways:
        left = way()
        tried.append((abs(whole.volume() - lost.volume() - left.volume()), left))
        if tried[-1][0] <= BALANCE * whole.volume():
            break
    return min(tried, key=lambda item: item[0])[1]


def iou(first: Mesh | None, second: Mesh | None) -> float:
    """Intersection over union of two solids by volume, from 0 to 1.

    None and a mesh without triangles mean that there is no solid: two of them give 1, one of them 0. Raises ValueError
    where manifold3d rejects one.
    """
    first, second = (mesh if mesh is not None and len(mesh.faces) else None for mesh in (first, second))
    if first is None or second is None:
        return float(first is second)
    origin = first.bounds.mean(axis=0)
    a, b = to_manifold(first, origin), to_manifold(second, origin)
    common = (a ^ b).volume()
    return float(common / (a.volume() + b.volume() - common))
