"""Solids to manifold3d and back in float64, moved near the origin on the way so that far coordinates cost no digits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Floats, Ints, Mesh, Solid

BALANCE = 1e-7
"""Share of a solid's volume by which what is cut off and what is left may differ from it together."""


def to_manifold(mesh: Mesh, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """A ``manifold3d.Manifold`` of a watertight mesh, its coordinates relative to ``origin``.

    Raises ValueError where manifold3d does not take the mesh for a closed, oriented one.
    """
    from manifold3d import Error, Manifold, Mesh64

    vertices = np.array(mesh.vertices - np.asarray(origin, dtype=np.float64), dtype=np.float64, order="C")
    body = Manifold(Mesh64(vertices, np.array(mesh.faces, dtype=np.uint64, order="C")))
    if body.status() != Error.NoError:
        raise ValueError(f"manifold3d refuses the mesh: {body.status().name}")
    return body


def to_arrays(body: Any, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) of a Manifold, moved by ``origin``."""
    mesh = body.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3] + np.asarray(origin, dtype=np.float64)
    return vertices, np.asarray(mesh.tri_verts).astype(np.int64)


def to_solid(body: Any, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Solid | None:
    """A Manifold as a Solid, moved by ``origin``; None where it is empty or has no volume to speak of."""
    if body.is_empty():
        return None
    vertices, faces = to_arrays(body, origin)
    try:
        return Solid(vertices, faces)
    except ValueError:
        return None


def concatenate_meshes(meshes: Sequence[Mesh]) -> tuple[Floats, Ints, Ints]:
    """Vertices (V,3) and faces (F,3) of several meshes as one, and the number (F,) of the mesh that each came from.

    Vertices stay as they are: equal ones of two meshes are not merged.
    """
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes]) if meshes else np.empty((0, 3))
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    return vertices, faces, owner


def unite(solids: Iterable[Mesh], origin: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """The union of watertight meshes as a Manifold, relative to ``origin``; empty where there are none."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean([to_manifold(solid, origin) for solid in solids] or [Manifold()], OpType.Add)


def subtract_lost(whole: Any, lost: Any) -> Any:
    """``whole`` minus ``lost``, which lies inside it; both Manifolds, and so is what is given.

    Where faces of the two coincide, as a damage volume's outer ones do with the part's, manifold3d 3.5 was seen to take
    off an eighth too little without a word. So volumes are balanced: of several ways to the same difference, the first
    that leaves no volume unaccounted for is taken, else the nearest.
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
    """Intersection over union of two solids; 1 where both are nothing."""
    if first is None or second is None:
        return float(first is second)
    origin = first.bounds.mean(axis=0)
    a, b = to_manifold(first, origin), to_manifold(second, origin)
    common = (a ^ b).volume()
    return float(common / (a.volume() + b.volume() - common))
