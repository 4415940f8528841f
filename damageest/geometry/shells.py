"""The closed shells of a mesh: which of them lie in others, which touch or cross, and the solid they bound.

Coordinates may be in any unit and frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.errors import InputError
from damageest.geometry.duplicates import list_used
from damageest.geometry.solids import to_arrays

MOST_PAIRS = 5000
"""Pairs of shells with overlapping bounds up to which each pair is compared; above it the windings are taken as they
are, and all are united at once."""
ALIKE = 1e-9
"""Share of two volumes, or of an area, up to which these are equal."""
UNITED = 1e-6
"""Share of the sum of volumes by which a union may leave the range that its bodies allow."""


class Shells:
    """Closed shells of a mesh.

    Attributes:
        faces_out: (S,) whether the windings of each shell face outward, as read.
        should_face_out: (S,) whether it bounds a body; else it bounds a cavity. After `relate`.
        are_apart: whether no two shells touch or cross. After `relate`.
    """

    def __init__(self, vertices: Floats, faces: Ints, label: Ints, faces_out: Flags) -> None:
        """``label``: (F,) the shell of each face, with consistent windings; ``faces_out`` (S,) as above."""
        self.faces_out = self.should_face_out = faces_out
        self.are_apart = True
        self._origin = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self._vertices, self._faces, self._label = vertices, faces, label
        self._bodies: dict[int, Any] = {}
        self._group = np.arange(len(faces_out))  # shells that touch or cross have one number
        self._depth = np.zeros(len(faces_out), np.int64)  # in how many others each one lies

    def relate(self, outward: bool) -> None:
        """Finds which shells lie in others, and which touch. ``outward``: the windings are those of a CAD kernel."""
        count = len(self.faces_out)
        pairs = self._list_near_pairs()
        if len(pairs) > MOST_PAIRS:
            self.are_apart, self._depth = False, np.where(self.faces_out, 0, 1)
            self._group = self._depth.copy()
            return
        inside, joined = [], []
        for first, second in pairs:
            kind, touches = self._compare(first, second)
            inner, outer = (first, second) if kind == "first inside" else (second, first)
            is_cavity = self.faces_out[inner] != self.faces_out[outer] or not (touches or outward)
            self.are_apart &= not touches and (kind == "apart" or is_cavity)
            if kind != "apart" and kind != "crossing" and is_cavity:
                inside.append((inner, outer))
            elif kind != "apart" or touches:
                joined.append((first, second))
        links = np.array(joined, np.int64).reshape(-1, 2)
        self._group = label_components(links[:, 0], links[:, 1], count)[0]
        around: list[set[int]] = [set() for _ in range(count)]
        for inner, outer in inside:
            if self._group[inner] != self._group[outer]:
                around[self._group[inner]].add(int(self._group[outer]))
        self._depth = np.array([len(around[group]) for group in self._group], np.int64)
        self.should_face_out = self._depth % 2 == 0

    def unite(self) -> tuple[Floats, Ints]:
        """Vertices and faces of the solid: bodies that touch or cross are united, cavities are taken out.

        Raises InputError where that cannot be computed, or gives a volume that the bodies do not allow.
        """
        import manifold3d as m3

        whole = m3.Manifold()
        for depth in range(int(self._depth.max()) + 1):
            for group in np.unique(self._group[self._depth == depth]):
                united = self._unite_group([int(one) for one in np.flatnonzero(self._group == group)])
                whole = whole - united if depth % 2 else whole + united
        if whole.status() != m3.Error.NoError or whole.is_empty():
            raise InputError(
                "its overlapping bodies could not be united; unite them in the CAD system and export again"
            )
        vertices, faces = to_arrays(whole, self._origin)
        return vertices, faces

    def _unite_group(self, members: list[int]) -> Any:
        """The union of shells that touch or cross, each as a body."""
        import manifold3d as m3

        bodies = [self._make_body(one) for one in members]
        for body in bodies:
            if body.status() != m3.Error.NoError:
                raise InputError(
                    f"{len(self.faces_out)} of its bodies overlap, and one of them is not a solid ({body.status()}); "
                    "unite them in the CAD system and export again"
                )
        united = m3.Manifold.batch_boolean(bodies, m3.OpType.Add)
        volumes = np.array([body.volume() for body in bodies])
        slack = UNITED * volumes.sum()
        if not volumes.max() - slack <= united.volume() <= volumes.sum() + slack:
            raise InputError(
                f"the union of {len(members)} of its bodies has a volume of {united.volume():.6g}, but the largest has "
                f"{volumes.max():.6g}, and all together {volumes.sum():.6g}; unite them in the CAD system and "
                "export again"
            )
        return united

    def _list_near_pairs(self) -> list[tuple[int, int]]:
        """Pairs of shells whose bounds overlap."""
        count = len(self.faces_out)
        if count == 1:
            return []
        corners = self._vertices[self._faces]
        order = np.argsort(self._label, kind="stable")
        starts = np.searchsorted(self._label[order], np.arange(count))
        low = np.minimum.reduceat(corners.min(axis=1)[order], starts)
        high = np.maximum.reduceat(corners.max(axis=1)[order], starts)
        return [
            (one, int(other))
            for one in range(count - 1)
            for other in one
            + 1
            + np.flatnonzero(((low[one] <= high[one + 1 :]) & (low[one + 1 :] <= high[one])).all(axis=1))
        ]

    def _make_body(self, shell: int) -> Any:
        """The shell as a body with positive volume, about the origin of all."""
        if shell not in self._bodies:
            faces = self._faces[self._label == shell]
            turned = faces if self.faces_out[shell] else faces[:, ::-1]
            self._bodies[shell] = to_body(*drop_unused_vertices(self._vertices - self._origin, turned))
        return self._bodies[shell]

    def _compare(self, first: int, second: int) -> tuple[str, bool]:
        """How two shells lie: "apart", "first inside", "second inside" or "crossing"; and whether they touch or cross.

        Two bodies are apart if the volume of their union is the sum of their volumes, and one is inside the other if it
        is the larger of the two. A smaller surface area of the union, or of the difference, shows that they touch.
        """
        a, b = self._make_body(first), self._make_body(second)
        union = a + b
        volume, area = union.volume(), union.surface_area()
        small = ALIKE * (a.volume() + b.volume())
        if abs(volume - a.volume() - b.volume()) <= small:
            return "apart", area < (a.surface_area() + b.surface_area()) * (1 - ALIKE)
        if abs(volume - max(a.volume(), b.volume())) <= small < abs(a.volume() - b.volume()):  # not one body twice
            (inner, outer), kind = ((a, b), "first inside") if a.volume() < b.volume() else ((b, a), "second inside")
            both = outer.surface_area() + inner.surface_area()
            return kind, (outer - inner).surface_area() < both * (1 - ALIKE)
        return "crossing", True


def label_components(a: Ints, b: Ints, count: int) -> tuple[Ints, int]:
    """Component (count,) of each of ``count`` nodes under the links from ``a`` to ``b``, and how many there are."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    bodies, label = connected_components(
        coo_matrix((np.ones(len(a), bool), (a, b)), shape=(count, count)), directed=False
    )
    return label.astype(np.int64), int(bodies)


def to_body(vertices: Floats, faces: Ints) -> Any:
    """The mesh as a manifold3d body, whose status the caller checks; coordinates should be near the origin."""
    import manifold3d as m3

    # copies, because manifold3d rejects read-only arrays, as those of artefacts are
    return m3.Manifold(
        m3.Mesh64(np.array(vertices, dtype=np.float64, order="C"), np.array(faces, dtype=np.uint64, order="C"))
    )


def drop_unused_vertices(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The same mesh without vertices that no face uses."""
    used = list_used(faces)
    if len(used) == len(vertices):
        return vertices, faces
    index = np.zeros(len(vertices), np.int64)
    index[used] = np.arange(len(used))
    return vertices[used], index[faces]
