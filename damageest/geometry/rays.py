"""Straight rays through triangle meshes: what a scanner at a known position sees, and what its rays passed through.

Mesh, origins and ends are in one unit and one frame. Coordinates are moved to the centre of the mesh's bounds; the ray
engine (Embree) then works in float32, so that places are exact to about 1e-6 of the distance to the ray's origin. Where
embreex has no wheel, as on Linux of 64-bit ARM, libigl's tree is asked, in float64 and about six times as slow.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.vectors import cross_corners
from damageest.isolation.memory import require_memory

BYTES_OF_TRIANGLE = 150
"""Memory of a mesh prepared for rays, for each triangle, measured."""
BYTES_OF_FIRST = 140 * 10**6
"""What Embree reserves with the first mesh. It does not survive where that is refused."""
MOST_HITS = 64
"""Surfaces that are counted along a ray."""


class Crossings(NamedTuple):
    """Where rays cross a mesh, in the order of the surfaces along each ray: ``ray`` (K,) and ``face`` (K,), their
    numbers; ``distance`` (K,) from the ray's origin; ``enters`` (K,): whether the ray enters there the side that the
    face's normal points away from."""

    ray: Ints
    face: Ints
    distance: Floats
    enters: np.ndarray[tuple[int], np.dtype[np.bool_]]


_started: list[bool] = []


class RayCaster:
    """A mesh prepared for rays."""

    def __init__(self, mesh: Mesh) -> None:
        needed = BYTES_OF_TRIANGLE * len(mesh.faces) + BYTES_OF_FIRST * (not _started)
        require_memory(needed, f"rays through {len(mesh.faces):,} triangles", "more memory (--memory)")
        _started[:] = [True]
        self._centre = mesh.bounds.mean(axis=0) if len(mesh.vertices) else np.zeros(3)
        self._scale = mesh.diagonal if len(mesh.vertices) else 0.0
        triangles = mesh.triangles - self._centre
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ModuleNotFoundError:
            self._scene: Any = _Tree(triangles)
            return
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.ascontiguousarray(triangles, np.float32))

    def find_first(self, origins: Floats, directions: Floats) -> tuple[Floats, Ints]:
        """Distance (R,) to the first surface that rays from ``origins`` (R,3) meet in unit ``directions`` (R,3), inf
        where they meet none, and its face (R,), -1 where there is none."""
        start, distance, face, _ = self._cast(origins, directions, np.zeros(len(origins)))
        return np.where(face >= 0, distance + start, np.inf), face

    def find_crossings(self, origins: Floats, ends: Floats) -> Crossings:
        """All surfaces that straight segments from ``origins`` (R,3) to ``ends`` (R,3) cross.

        A segment that runs within a face crosses it or not.
        """
        way = ends - origins
        length = np.linalg.norm(way, axis=1)
        directions = way / np.maximum(length, 1e-300)[:, None]
        step = 2e-6 * (self._scale + np.linalg.norm(origins - self._centre, axis=1))
        travelled = np.zeros(len(origins))
        active = np.arange(len(origins))
        found: list[tuple[Ints, Ints, Floats, np.ndarray[tuple[int], np.dtype[np.bool_]]]] = []
        for _ in range(MOST_HITS):
            if not len(active):
                break
            start, more, face, facing = self._cast(origins[active], directions[active], travelled[active])
            distance = start + more
            hit = (face >= 0) & (distance < length[active])
            active, distance = active[hit], distance[hit]
            found.append((active, face[hit], distance, facing[hit] < 0))
            travelled[active] = distance + step[active]
        if not found:
            return Crossings(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0, np.bool_))
        ray, face, distance, enters = (np.concatenate([one[k] for one in found]) for k in range(4))
        order = np.lexsort((distance, ray))
        return Crossings(ray[order], face[order], distance[order], enters[order])

    def _cast(self, origins: Floats, directions: Floats, begin: Floats) -> tuple[Floats, Floats, Ints, Floats]:
        """Rays that begin ``begin`` (R,) beyond their origins: how far from the origin they were started, the distance
        from there, the face (-1: none), and the dot product of ray and face normal, all (R,).

        A ray from far away is started near the mesh, where float32 has more digits.
        """
        place = origins - self._centre
        along = -np.einsum("ij,ij->i", place, directions)
        start = np.maximum(along - 1.01 * self._scale, begin)
        place = (place + start[:, None] * directions).astype(np.float32)
        seen = self._scene.run(place, directions.astype(np.float32), output=True)
        facing = np.einsum("ij,ij->i", directions, seen["Ng"])
        return start, seen["tfar"].astype(np.float64), seen["primID"].astype(np.int64), facing


_last: WeakKeyDictionary[Mesh, RayCaster] = WeakKeyDictionary()
"""The mesh that was prepared last: more would hold memory that the next stages need."""


def prepare_rays(mesh: Mesh) -> RayCaster:
    """The mesh prepared for rays, from the last call or made now; for the part, which several checks need."""
    if (found := _last.get(mesh)) is None:
        _last.clear()
        found = _last[mesh] = RayCaster(mesh)
    return found


def measure_thickness(mesh: Mesh, places: Floats, normals: Floats) -> Floats:
    """The thickness (N,) of a closed mesh below places (N,3) on it, against their outward normals (N,3); inf where a
    ray meets nothing."""
    start = places - 1e-5 * mesh.diagonal * normals  # off the face that the place lies on
    return prepare_rays(mesh).find_first(start, -normals)[0]


class _Tree:
    """Triangles (F,3,3) in libigl's tree of boxes, asked as Embree's scene is."""

    def __init__(self, triangles: Floats) -> None:
        import igl

        self._vertices, self._faces = triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
        self._across = cross_corners(triangles)
        self._tree = igl.AABB()
        if len(triangles):
            self._tree.init(self._vertices, self._faces)

    def run(self, origins: Any, directions: Any, output: bool) -> dict[str, Any]:
        if not len(self._faces) or not len(origins):
            none = np.full(len(origins), -1)
            return {"tfar": np.full(len(origins), np.inf), "primID": none, "Ng": np.zeros((len(origins), 3))}
        origins, directions = origins.astype(np.float64), directions.astype(np.float64)
        face, distance, _ = self._tree.intersect_ray_first(self._vertices, self._faces, origins, directions)
        distance = np.where(face >= 0, distance, np.inf)
        return {"tfar": distance, "primID": face, "Ng": self._across[face]}
