"""The values that stages give to each other.

All are frozen and their arrays are read-only: a stage gives a new value, it never edits one. Lengths are in the job's
unit, coordinates float64 (N,3), faces int64 (F,3). Frames: a `Scan` as read is in the scanner's frame; everything
after `align` is in the part's. ``T_part_scan`` takes a point from the scanner's frame to the part's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Vector = tuple[float, float, float]

INTACT, DAMAGE, ADDED, OUTLIER = 0, 1, 2, 3
"""Labels of a scan point: on the nominal surface; on an inner damage surface; outside the part by more than the
tolerance (weld bead, dirt, fixture); deviating, but in no site (noise)."""


class ArtefactError(ValueError):
    """The data do not fit the artefact's type: wrong shapes, indices out of range, a solid that is not closed."""


def _frozen(value: Any, dtype: Any) -> Any:
    array = np.array(value, dtype=dtype, order="C", copy=None)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


class _Arrays:
    """Converts the array fields named in ``_dtypes`` and makes them read-only when the dataclass is made."""

    _dtypes: ClassVar[dict[str, Any]] = {}

    def __post_init__(self) -> None:
        for name, dtype in self._dtypes.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _frozen(value, dtype))


@dataclass(frozen=True, eq=False)
class Mesh(_Arrays):
    """A triangle mesh: ``vertices`` (V,3) float64, ``faces`` (F,3) int64, counter-clockwise from outside."""

    vertices: Floats
    faces: Ints
    _dtypes: ClassVar[dict[str, Any]] = {"vertices": np.float64, "faces": np.int64}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise ArtefactError(f"vertices: expected (V,3), got {self.vertices.shape}")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise ArtefactError(f"faces: expected (F,3), got {self.faces.shape}")
        if len(self.faces) and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise ArtefactError(f"faces: index outside the {len(self.vertices)} vertices")
        if not np.isfinite(self.vertices).all():
            raise ArtefactError("vertices: not all finite")

    @property
    def triangles(self) -> Floats:
        """(F,3,3) corner coordinates."""
        return self.vertices[self.faces]

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
        return float(np.linalg.norm(self.cross, axis=1).sum() / 2)

    @cached_property
    def bounds(self) -> Floats:
        """(2,3) lowest and highest corner."""
        return np.array([self.vertices.min(0), self.vertices.max(0)])

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))


def open_edges(faces: Ints) -> int:
    """How many directed edges lack their opposite exactly once, or go from a vertex to itself; 0 for a closed,
    consistently oriented 2-manifold."""
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
        centre = (self.vertices.min(0) + self.vertices.max(0)) / 2
        a, b, c = np.moveaxis(self.triangles - centre, 1, 0)
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@dataclass(frozen=True, eq=False)
class Deposit(Solid):
    """What is to be deposited for one damage, including stock to be milled off.

    ``cavity`` is the damage volume (DV) enlarged by the cut-back into intact metal, None without a cut-back;
    ``cut_back_volume`` the volume that this removes in addition. ``stock_volume``: what is above the nominal surface;
    ``thickness``: its least, mean and largest height over the skin where stock was asked for, None where none was;
    ``touched``: the numbers of the CAD faces that stock stands on, as in `Part.faces_brep`, empty where the part has
    none. ``heights``: of the damage's CAD faces by number, how high the job wants the stock on it, -1 where that is not
    the same all over it; ``overlap``: how far the stock covers the intact skin. ``notes`` are warnings.
    """

    cavity: Solid | None = None
    stock_volume: float = 0.0
    cut_back_volume: float = 0.0
    thickness: tuple[float, float, float] | None = None
    touched: tuple[int, ...] = ()
    heights: tuple[tuple[int, float], ...] = ()
    overlap: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Surface(Mesh):
    """An open mesh: the inner damage surface (IDS), normals toward the lost material."""


@dataclass(frozen=True, eq=False)
class Part(Solid):
    """The part as designed.

    ``faces_brep`` (F,) gives the number of the CAD face that each triangle came from, ``face_names`` and
    ``face_kinds`` what the CAD calls them; None and empty where the file was a mesh. ``tessellation_error`` bounds
    the distance between the CAD surface and the triangles. ``cad_scale``: one length of the CAD file, as its reader
    takes it, in ``unit``; 0 where the file was a mesh. ``notes`` say what was repaired or converted.
    """

    unit: str = "mm"
    path: str = ""
    sha256: str = ""
    faces_brep: Ints | None = None
    face_names: tuple[str, ...] = ()
    face_kinds: tuple[str, ...] = ()
    tessellation_error: float = 0.0
    notes: tuple[str, ...] = ()
    cad_scale: float = 0.0
    _dtypes: ClassVar[dict[str, Any]] = {**Mesh._dtypes, "faces_brep": np.int64}


@dataclass(frozen=True, eq=False)
class Truth(_Arrays):
    """The truth of a virtual scan: the true ``damage`` in the part's frame (None if there is none), the pose, and the
    metal ``added`` outside the part, in the part's frame (None if there is none)."""

    damage: Solid | None
    T_part_scan: Floats
    added: Solid | None = None
    _dtypes: ClassVar[dict[str, Any]] = {"T_part_scan": np.float64}


@dataclass(frozen=True, eq=False)
class Scan(_Arrays):
    """Points (N,3) on the damaged part; ``normals`` (N,3) outward, or None.

    ``noise`` is the measured standard deviation of the points off the local surface and ``spacing`` the median distance
    to the nearest neighbours that a reconstructed surface has to bridge; both 0 until measured. ``viewpoints`` (V,3):
    where the scanner stood for each view, in the frame of the points; ``view`` (N,): the number of each point's view,
    -1 where its scanner position is not known. Both None where no position is known. ``total``: number of points in
    the files where only some of them are here, else 0.
    """

    points: Floats
    normals: Floats | None = None
    unit: str = "mm"
    paths: tuple[str, ...] = ()
    noise: float = 0.0
    spacing: float = 0.0
    truth: Truth | None = None
    notes: tuple[str, ...] = ()
    viewpoints: Floats | None = None
    view: NDArray[np.int32] | None = None
    total: int = 0
    _dtypes: ClassVar[dict[str, Any]] = {
        "points": np.float64,
        "normals": np.float64,
        "viewpoints": np.float64,
        "view": np.int32,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise ArtefactError(f"points: expected (N,3), got {self.points.shape}")
        if self.normals is not None and self.normals.shape != self.points.shape:
            raise ArtefactError(f"normals: expected {self.points.shape}, got {self.normals.shape}")
        if (self.viewpoints is None) != (self.view is None):
            raise ArtefactError("viewpoints and view: give both or none")
        if self.viewpoints is not None and self.view is not None:
            if self.viewpoints.ndim != 2 or self.viewpoints.shape[1] != 3:
                raise ArtefactError(f"viewpoints: expected (V,3), got {self.viewpoints.shape}")
            if self.view.shape != (len(self.points),):
                raise ArtefactError(f"view: expected ({len(self.points)},), got {self.view.shape}")
            if len(self.view) and not -1 <= self.view.min() <= self.view.max() < len(self.viewpoints):
                raise ArtefactError(f"view: number outside the {len(self.viewpoints)} viewpoints")

    def move(self, T: Floats) -> Scan:
        """The same scan in another frame; T is 4x4, rigid."""
        # not @: on long, narrow arrays it takes several times as long
        points = np.einsum("ij,kj->ik", self.points, T[:3, :3])
        points += T[:3, 3]
        normals = None if self.normals is None else np.einsum("ij,kj->ik", self.normals, T[:3, :3])
        viewpoints = None if self.viewpoints is None else self.viewpoints @ T[:3, :3].T + T[:3, 3]
        return replace(self, points=points, normals=normals, viewpoints=viewpoints)

    def take(self, index: Ints | Flags) -> Scan:
        """The scan with some of its points: their numbers (M,), or whether each is taken (N,)."""
        normals = None if self.normals is None else self.normals[index]
        return replace(
            self, points=self.points[index], normals=normals, view=None if self.view is None else self.view[index]
        )


@dataclass(frozen=True, eq=False)
class Samples(_Arrays):
    """CAD points: ``points`` (N,3) exactly on the part, ``normals`` (N,3) of the face that each lies on (bisecting
    ones on edges and corners), ``face`` (N,) the triangle, ``kind`` (N,): 0 on a face, 1 on a sharp edge, 2 on a
    corner. ``spacing`` is the largest intended gap."""

    points: Floats
    normals: Floats
    face: Ints
    kind: NDArray[np.uint8]
    spacing: float
    _dtypes: ClassVar[dict[str, Any]] = {
        "points": np.float64,
        "normals": np.float64,
        "face": np.int64,
        "kind": np.uint8,
    }


@dataclass(frozen=True)
class Unreached:
    """Deposit that no pass fills: its ``volume`` and ``why``."""

    volume: float
    why: str


@dataclass(frozen=True)
class BeadFill:
    """The union of a path's beads against the deposit, on voxels with the edge ``voxel``.

    ``filled``: share of the reachable deposit that is filled. ``gap``: volume of the reachable deposit that is not;
    ``largest_gap``: that of its largest connected piece; ``void``: diameter of the largest ball in it. ``spill``:
    volume of beads outside the deposit and the metal; ``spill_distance``: how far it reaches from the deposit.
    ``sunk``: volume of beads where metal is already.
    """

    voxel: float
    filled: float
    gap: float
    void: float
    largest_gap: float
    spill: float
    spill_distance: float
    sunk: float


@dataclass(frozen=True, eq=False)
class DepositPath(_Arrays):
    """Moves of the tool that build up one site's deposit, in the part's frame.

    ``points`` (N,3): where the tool works, on the top of the bead. ``axes`` (N,3): the tool axis, a unit vector away
    from the work; the nozzle's tip is ``standoff`` along it from the point. ``normals`` (N,3): the normal of the layer.
    ``feed`` (N,): speed of the move that ends there, in lengths a minute; ``on`` (N,): whether it deposits. ``layer``,
    ``number``, ``part`` (N,): of layer, pass and part of the deposit, from 1. ``directions`` (P,3): the build direction
    of each part; ``heights`` (P,): of its layers. ``width`` of a bead; ``section``: area of its section, that of what
    it adds. ``nozzle``: its mesh, tip at 0, axis along z. ``clearance``: least distance of the nozzle from anything
    while it deposits, ``travel_clearance`` while it travels; inf without obstacles. ``tightest`` (2,3): point and axis
    where it is least. ``unreached``: what is not filled, by reason, and ``missing``: the same as a solid. ``fill``: the
    simulated beads; None where they were not simulated. ``notes`` are warnings.
    """

    points: Floats
    axes: Floats
    normals: Floats
    feed: Floats
    on: Flags
    layer: Ints
    number: Ints
    part: Ints
    directions: Floats
    heights: Floats
    width: float
    section: Floats
    standoff: float
    deposit_volume: float
    nozzle: Mesh
    clearance: float
    travel_clearance: float
    tightest: Floats | None = None
    unreached: tuple[Unreached, ...] = ()
    missing: Solid | None = None
    fill: BeadFill | None = None
    notes: tuple[str, ...] = ()
    _dtypes: ClassVar[dict[str, Any]] = {
        "points": np.float64, "axes": np.float64, "normals": np.float64, "feed": np.float64, "on": np.bool_,
        "layer": np.int64, "number": np.int64, "part": np.int64, "directions": np.float64, "heights": np.float64,
        "section": np.float64, "tightest": np.float64,
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.points)
        for name in ("points", "axes", "normals"):
            if getattr(self, name).shape != (count, 3):
                raise ArtefactError(f"{name}: expected {(count, 3)}, got {getattr(self, name).shape}")
        for name in ("feed", "on", "layer", "number", "part"):
            if getattr(self, name).shape != (count,):
                raise ArtefactError(f"{name}: expected {(count,)}, got {getattr(self, name).shape}")
        if count and not np.allclose(np.linalg.norm(self.axes, axis=1), 1, atol=1e-6):
            raise ArtefactError("axes: not all have the length 1")
        if count and not (np.isfinite(self.points).all() and (self.feed > 0).all()):
            raise ArtefactError("points: not all finite, or a feed is not above 0")
        if count and self.on[0]:
            raise ArtefactError("on: the first move has no start, so it cannot deposit")

    @cached_property
    def moves(self) -> Floats:
        """(N,) length of the move that ends at each point; 0 for the first."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], steps]) if len(self.points) else np.empty(0)

    @property
    def length(self) -> float:
        """Length of all passes."""
        return float(self.moves[self.on].sum())

    @property
    def travel(self) -> float:
        """Length of the moves between passes."""
        return float(self.moves[~self.on].sum())

    @property
    def minutes(self) -> float:
        """Time of all moves at their feeds, without acceleration."""
        return float((self.moves / self.feed).sum()) if len(self.points) else 0.0

    @property
    def passes(self) -> int:
        return int(self.number[-1]) if len(self.points) else 0

    @property
    def layers(self) -> int:
        """Number of layers, summed over the parts of the deposit."""
        return len(np.unique(np.stack([self.part, self.layer]), axis=1).T) if len(self.points) else 0

    @property
    def bead_volume(self) -> float:
        """Volume that the passes add: length by section."""
        return float((self.moves * self.section[self.part - 1])[self.on].sum()) if len(self.points) else 0.0

    @property
    def unreached_volume(self) -> float:
        return sum(item.volume for item in self.unreached)


@dataclass(frozen=True)
class FreeMotion:
    """A motion that unworn skin does not exclude: after it the scan fits the part as well.

    ``direction``: unit vector of a shift, or of the axis of a turn through ``point`` (None: a shift), in the part's
    frame. ``low``, ``high``: how far the scan can be moved, 0 being the pose found, in the job's unit; of a turn, the
    movement of the skin that moves most. ``turn``: angle in radians for each unit of it, 0 for a shift. ``text``: the
    same in words.
    """

    direction: Vector
    low: float
    high: float
    point: Vector | None = None
    turn: float = 0.0
    text: str = ""

    def move(self, points: Floats) -> Floats:
        """How points (N,3) of the scan, in the part's frame, move for each unit of the motion (N,3)."""
        if self.point is None:
            return np.tile(np.array(self.direction), (len(points), 1))
        return np.cross(self.turn * np.array(self.direction), points - np.array(self.point))


@dataclass(frozen=True, eq=False)
class Pose(_Arrays):
    """``T_part_scan`` (4,4), rigid. ``rms`` of the inliers' distance to the part, ``inliers`` their share of the scan.

    ``alternatives`` (K,4,4) are other poses that fit the scan equally well, as on a symmetric part: then the pose is
    one of several right ones. ``notes`` say so in words. ``doubts``: those of the notes that make the verdict on every
    site doubtful, such as a small share of the scan on the part, or other poses that fit and are no symmetries.
    ``free``: motions that unworn skin does not exclude. ``is_held``: whether skin without wear holds the pose but for
    those; False where that was not tested.
    """

    T_part_scan: Floats
    rms: float = 0.0
    inliers: float = 1.0
    alternatives: Floats | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    free: tuple[FreeMotion, ...] = ()
    is_held: bool = False
    _dtypes: ClassVar[dict[str, Any]] = {"T_part_scan": np.float64, "alternatives": np.float64}


@dataclass(frozen=True, eq=False)
class Deviation(_Arrays):
    """Per scan point, in the part's frame: ``distance`` (N,) signed to the part's surface, positive outside; ``face``
    (N,) the nearest triangle; ``label`` (N,), one of INTACT, DAMAGE, ADDED, OUTLIER. ``notes`` say what the scan
    does not show."""

    distance: Floats
    face: Ints
    label: NDArray[np.uint8]
    notes: tuple[str, ...] = ()
    _dtypes: ClassVar[dict[str, Any]] = {"distance": np.float64, "face": np.int64, "label": np.uint8}

    def __post_init__(self) -> None:
        super().__post_init__()
        if wrong := int((~np.isfinite(self.distance)).sum()):
            raise ArtefactError(f"distance: {wrong} of {len(self.distance)} are not finite numbers")


@dataclass(frozen=True, eq=False)
class Sites(_Arrays):
    """``label`` (N,) int32 per scan point: the number of its site from 1 up, 0 for a point of none. ``count`` sites."""

    label: NDArray[np.int32]
    count: int
    notes: tuple[str, ...] = ()
    _dtypes: ClassVar[dict[str, Any]] = {"label": np.int32}

    def members(self, site: int) -> Ints:
        """Indices of the scan points of one site."""
        return np.flatnonzero(self.label == site)


@dataclass(frozen=True, eq=False)
class Rims:
    """Closed loops of vertex indices of an IDS, each following the surface's own boundary edges, longest first."""

    loops: tuple[Ints, ...]


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A solid that contains the damage of ``sites`` and no intact metal; ``notes`` say what is doubtful about it."""

    solid: Solid
    sites: tuple[int, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Enclosures:
    """The enclosures of all sites of a job: disjoint, each site in one of them."""

    items: tuple[Enclosure, ...]


EvidenceCause = Literal["residual", "inside", "contradicted", "bare", "shallow", "unseen"]


@dataclass(frozen=True)
class Evidence:
    """The check of one damage volume (DV) against the scan.

    ``ids_residual``: 95th percentile of the distance from the site's IDS points to the DV's boundary.
    ``intact_points_inside``: intact scan points on the skin that the DV removes.
    ``skin_contradicted``: share of the part's skin that the DV removes which intact scan points lie on.
    ``skin_unseen``: share of the part's skin beside the DV that has no scan point: no evidence either way.
    ``ids_unseen``: share of its inner surface without scan points near: there it is interpolated. ``ids_gap``: area of
    the largest connected piece of that.
    ``intact_share``: share of the skin that the DV removes on which intact points lie as densely as elsewhere, also
    near the rim. Unlike ``skin_contradicted``, it is measured on shallow and small sites too.
    ``consistent``: whether the scan agrees with the DV. ``reasons`` say why not, and ``causes`` names the check that
    gave each reason.
    """

    ids_residual: float = 0.0
    intact_points_inside: int = 0
    skin_contradicted: float = 0.0
    skin_unseen: float = 0.0
    ids_unseen: float = 0.0
    ids_gap: float = 0.0
    intact_share: float = 0.0
    consistent: bool = True
    reasons: tuple[str, ...] = ()
    causes: tuple[EvidenceCause, ...] = ()
