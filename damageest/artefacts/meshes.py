"""Surfaces and solids: meshes of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from damageest.artefacts.arrays import Flags, Floats, Ints
from damageest.artefacts.fields import ArtefactError, Checked, NotNegative, Shape, Span, require_index

ROUNDING = 1e-9
"""Relative error by which a mean of equal numbers may leave them."""


@dataclass(frozen=True, eq=False)
class Mesh(Checked):
    """A triangle mesh: ``vertices`` (V,3) float64, ``faces`` (F,3) int64, counter-clockwise from outside."""

    vertices: Annotated[Floats, Shape("V", 3)]
    faces: Annotated[Ints, Shape("F", 3)]

    def __post_init__(self) -> None:
        super().__post_init__()
        require_index("faces", self.faces, len(self.vertices), "vertices")

    @property
    def triangles(self) -> Floats:
        """(F,3,3) corner coordinates."""
        return np.take(self.vertices, self.faces, axis=0)  # half the time of indexing

    def take_triangles(self, chosen: Ints | Flags) -> Floats:
        """(K,3,3) corner coordinates of the ``chosen`` faces, (K,) numbers or (F,) flags: of a large mesh, much faster
        than to take them from `triangles`."""
        return np.take(self.vertices, self.faces[chosen], axis=0)

    @cached_property
    def cross(self) -> Floats:
        """(F,3) face normals scaled by twice the area."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def face_normals(self) -> Floats:
        """(F,3) unit normals of the faces; 0 where a face has no area."""
        return np.asarray(self.cross / np.maximum(np.linalg.norm(self.cross, axis=1), 1e-300)[:, None])

    @cached_property
    def face_areas(self) -> Floats:
        """(F,) areas of the faces."""
        return np.asarray(np.linalg.norm(self.cross, axis=1) / 2)

    @cached_property
    def vertex_cross(self) -> Floats:
        """(V,3) sum of the faces' `cross` at each vertex: a normal weighted by area, of no unit length."""
        total = np.zeros_like(self.vertices)
        for corner in range(3):
            np.add.at(total, self.faces[:, corner], self.cross)
        return total

    @property
    def vertex_normals(self) -> Floats:
        """(V,3) unit normals of the vertices; 0 where there is none."""
        length = np.linalg.norm(self.vertex_cross, axis=1)
        return np.asarray(self.vertex_cross / np.maximum(length, 1e-300)[:, None])

    @property
    def area(self) -> float:
        return float(self.face_areas.sum())

    @cached_property
    def bounds(self) -> Floats:
        """(2,3) lowest and highest corner."""
        return _find_bounds(self.vertices)

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))


def _find_bounds(points: Floats) -> Floats:
    """(2,3) lowest and highest corner of points (N,3), column by column: all at once takes six times as long."""
    return np.array([[end(column) for column in points.T] for end in (np.min, np.max)])


def open_edges(faces: Ints) -> int:
    """Number of directed edges without exactly one opposite, or from a vertex to itself; 0 for a closed, consistently
    oriented 2-manifold."""
    if not len(faces):
        return 0
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(faces.max()) + 1
    forward = edges[:, 0] * size + edges[:, 1]
    backward = edges[:, 1] * size + edges[:, 0]
    # most meshes are closed, and two sorts show it
    ordered = np.sort(forward)
    if (np.diff(ordered) > 0).all() and (edges[:, 0] != edges[:, 1]).all() and (ordered == np.sort(backward)).all():
        return 0
    codes, counts = np.unique(forward, return_counts=True)
    lone = (
        (counts > 1) | ~np.isin(codes, backward, assume_unique=True) | (codes % (size + 1) == 0)
    )  # the last: from a vertex to itself
    return int(lone.sum())


@dataclass(frozen=True, eq=False)
class Solid(Mesh):
    """A watertight mesh bounding positive volume, of one or more components.

    The constructor raises ArtefactError for anything else.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.faces):
            raise ArtefactError("a solid needs faces; this mesh is empty")
        if loose := open_edges(self.faces):
            raise ArtefactError(f"not watertight: {loose} of its edges are not shared by two opposite triangles")
        if self.volume <= 0:
            raise ArtefactError(f"inside out or flat: its signed volume is {self.volume:.6g}")

    @cached_property
    def volume(self) -> float:
        """By the divergence theorem, about the centre of the bounds (so that far coordinates cost no digits)."""
        centre = _find_bounds(self.vertices).sum(axis=0) / 2
        a, b, c = np.moveaxis(self.triangles - centre, 1, 0)
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@dataclass(frozen=True, eq=False)
class Deposit(Solid):
    """The solid to deposit for one damage, including stock to be milled off.

    ``cavity`` is the damage volume (DV) enlarged by the cut-back into intact metal, None without a cut-back;
    ``milled``: where the cavity was opened (`prepare`), the intact metal to be milled off before deposition, cut-back
    included: the DV then stays as it is. ``thickness``: its least, mean and largest height over skin with stock, None
    without stock; ``touched``: the numbers of the CAD faces that stock stands on, as in `Part.faces_brep`, empty where
    the part has none. ``heights``: wanted height of the stock by number of the damage's CAD faces, -1 where
    it varies on the face; ``overlap``: width of the intact skin under stock. ``notes`` are warnings. ``opening``: a
    solid that takes the cavity out of the part and stands out of it, None where the cavity is the damage volume or that
    is not known. Where the cavity was opened, no face of it lies on the skin, so that a difference leaves nothing over
    the opening.
    """

    cavity: Solid | None = None
    stock_volume: Annotated[NotNegative, "volume of the deposit beyond the nominal surface, to be milled off"] = 0.0
    cut_back_volume: Annotated[
        NotNegative, "volume of intact metal to remove before, for a clean surface or an open cavity"
    ] = 0.0
    thickness: Annotated[
        tuple[float, float, float] | None, Span(0.0), "thickness of the stock; null: no stock, or not measured"
    ] = None
    touched: tuple[int, ...] = ()
    heights: tuple[tuple[int, float], ...] = ()
    overlap: NotNegative = 0.0
    notes: tuple[str, ...] = ()
    milled: Solid | None = None
    opening: Solid | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        low, mean, high = self.thickness or (0.0, 0.0, 0.0)
        if not low <= mean * (1 + ROUNDING) or not mean <= high * (1 + ROUNDING):
            raise ArtefactError(f"thickness: expected least, mean and largest, got {self.thickness}")


@dataclass(frozen=True, eq=False)
class Surface(Mesh):
    """An open mesh: the inner damage surface (IDS), normals toward the lost material."""


@dataclass(frozen=True, eq=False)
class Part(Solid):
    """The part as designed.

    ``faces_brep`` (F,) gives the number of the CAD face that each triangle came from, ``face_names`` and ``face_kinds``
    what the CAD calls them; None and empty where the file was a mesh. ``cad_scale``: one length of the CAD file, as its
    reader takes it, in ``unit``; 0 where the file was a mesh.

    Where an earlier scan stands in place of the design: ``unseen`` (F,) has the triangles that only close the surface,
    since that scan has no points there, ``scan_noise`` the standard deviation of its points, and ``scan_spacing`` their
    spacing. None and 0 for a part as designed.
    """

    unit: str = "mm"
    path: str = ""
    sha256: str = ""
    faces_brep: Annotated[Ints | None, Shape("F")] = None
    face_names: tuple[str, ...] = ()
    face_kinds: tuple[str, ...] = ()
    tessellation_error: Annotated[NotNegative, "bound on the distance between CAD surface and triangles"] = 0.0
    notes: Annotated[tuple[str, ...], "repairs and conversions at reading"] = ()
    cad_scale: NotNegative = 0.0
    unseen: Annotated[Flags | None, Shape("F")] = None
    scan_noise: NotNegative = 0.0
    scan_spacing: NotNegative = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.faces_brep is not None:
            for name in ("face_names", "face_kinds"):
                if known := getattr(self, name):
                    require_index("faces_brep", self.faces_brep, len(known), name)
