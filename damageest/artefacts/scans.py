"""A scan, where it lies on the part, and what its points are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts.arrays import Bytes, Flags, Floats, Ints, Singles, Vector
from damageest.artefacts.fields import MOST, ArtefactError, Checked, Range, require_finite, require_index, require_shape
from damageest.artefacts.meshes import Solid
from damageest.artefacts.reasons import Reason

INTACT, DAMAGE, ADDED, OUTLIER = 0, 1, 2, 3
"""Labels of a scan point: on the nominal surface; on an inner damage surface; outside the part by more than the
tolerance (weld bead, dirt, fixture); deviating, but in no site (noise)."""


OF_POINTS = ("points", "normals", "view", "cloud", "colours", "confidence")
"""Fields of a scan, or of a file of points, with a row for each point."""

P = TypeVar("P")

MOST_CLOUDS = 1 << 30
RIGID = 1e-6
"""Largest error of a pose's numbers, of the rotation and of the last row."""


def require_rigid(name: str, poses: Floats) -> None:
    """Raises ArtefactError where one of the poses (4,4) or (K,4,4) is no rotation and shift."""
    require_finite(name, poses)
    turn = poses[..., :3, :3]
    if (np.abs(poses[..., 3, :] - [0.0, 0.0, 0.0, 1.0]) > RIGID).any():
        raise ArtefactError(f"{name}: the last row of a pose is 0, 0, 0, 1")
    with np.errstate(over="ignore", invalid="ignore"):
        product = turn @ np.swapaxes(turn, -1, -2)
        if not (np.abs(product - np.eye(3)) <= RIGID).all():
            raise ArtefactError(f"{name}: not rigid: its upper left 3x3 has scale or shear")
        if (np.linalg.det(turn) < 0).any():
            raise ArtefactError(f"{name}: not rigid: its upper left 3x3 mirrors (its determinant is -1)")


def take_points(of: P, index: Ints | Flags) -> P:
    """A scan, or a file of points, with some of its points: their numbers (M,), or whether each is taken (N,)."""
    given = {name: value for name in OF_POINTS if (value := getattr(of, name, None)) is not None}
    return replace(of, **{name: value[index] for name, value in given.items()})  # type: ignore[type-var]


@dataclass(frozen=True, eq=False)
class Truth(Checked):
    """The truth of a virtual scan: the true ``damage`` in the part's frame (None if there is none), the pose, and the
    metal ``added`` outside the part, in the part's frame (None if there is none). ``deformed``: the damage where it
    lies in a part that was deformed before it was scanned; None where it was not."""

    damage: Solid | None
    T_part_scan: Floats
    added: Solid | None = None
    deformed: Solid | None = None
    _dtypes: ClassVar[dict[str, Any]] = {"T_part_scan": np.float64}

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("T_part_scan", self.T_part_scan, 4, 4)
        require_rigid("T_part_scan", self.T_part_scan)


@dataclass(frozen=True, eq=False)
class Scan(Checked):
    """Points (N,3) on the damaged part; ``normals`` (N,3) outward, or None.

    ``noise`` is the measured standard deviation of the points off the local surface and ``spacing`` the median distance
    to the nearest neighbours that a reconstructed surface has to bridge; both 0 until measured. ``viewpoints`` (V,3):
    where the scanner stood for each view, in the frame of the points; ``view`` (N,): the number of each point's view,
    -1 where its scanner position is not known. Both None where no position is known. ``cloud`` (N,): the number of the
    cloud that each point came with, as of its file: the points of one cloud do not move against each other, whether its
    scanner position is known or not; -1 where that is not known. None: a view is a cloud. ``total``: number of points
    in the files where only some of them are here, else 0. ``colours`` (N,3) from 0 to 255, and ``confidence`` (N,) on
    the scale of the files, as the scanner's program wrote them; None where no file has them. Beside files with, the
    points of a file without are grey, and their confidence is no number. ``warnings``: what the reader doubts.
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
    colours: Bytes | None = None
    confidence: Singles | None = None
    warnings: tuple[Reason, ...] = ()
    cloud: NDArray[np.int32] | None = None
    _dtypes: ClassVar[dict[str, Any]] = {
        "points": np.float64,
        "normals": np.float64,
        "viewpoints": np.float64,
        "view": np.int32,
        "colours": np.uint8,
        "confidence": np.float32,
        "cloud": np.int32,
    }
    _ranges: ClassVar[dict[str, Range]] = {"noise": (0.0, MOST), "spacing": (0.0, MOST), "total": (0, MOST)}

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("points", self.points, "N", 3)
        if self.normals is not None:
            require_shape("normals", self.normals, len(self.points), 3)
        if self.colours is not None:
            require_shape("colours", self.colours, len(self.points), 3)
        if self.confidence is not None:
            require_shape("confidence", self.confidence, len(self.points))
        if (self.viewpoints is None) != (self.view is None):
            raise ArtefactError("viewpoints and view: give both or none")
        if self.viewpoints is not None and self.view is not None:
            require_shape("viewpoints", self.viewpoints, "V", 3)
            require_finite("viewpoints", self.viewpoints)
            require_shape("view", self.view, len(self.points))
            require_index("view", self.view, len(self.viewpoints), "viewpoints", least=-1)
        if self.cloud is not None:
            require_shape("cloud", self.cloud, len(self.points))
            require_index("cloud", self.cloud, MOST_CLOUDS, "clouds", least=-1)

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
        return take_points(self, index)


@dataclass(frozen=True, eq=False)
class Samples(Checked):
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
    _ranges: ClassVar[dict[str, Range]] = {"spacing": (0.0, MOST)}

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("points", self.points, "N", 3)
        count = len(self.points)
        require_shape("normals", self.normals, count, 3)
        require_shape("face", self.face, count)
        require_shape("kind", self.kind, count)
        require_finite("points", self.points)
        require_finite("normals", self.normals)
        require_index("kind", self.kind, 3, "kinds")
        if count and self.face.min() < 0:
            raise ArtefactError(f"face: expected numbers of triangles, got {self.face.min()}")


@dataclass(frozen=True)
class FreeMotion(Checked):
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
class DatumFit(Checked):
    """How one datum of a datum system was fitted to the scan, in the order of precedence.

    ``name``: its letter. ``kind``: its shape, as "plane", or "3 cylinders" for a pattern. ``faces``: numbers of its CAD
    faces, empty where the part is a mesh. ``takes``: the degrees of freedom that it fixes, as text in the part's frame.
    ``points``: scan points on it; ``contact``: the share of them on the fitted shape, ``inside``: below it, as where it
    is worn. ``rms``: of the means of patches in contact, in the job's unit. ``nominal`` and ``measured``: the radius of
    each cylinder and sphere, in the job's unit. ``shapes``: the kind of each of its shapes, with ``places`` on it (a
    plane's middle, on the axis, the apex, the centre), ``axes`` (a plane's outward normal; 0 for a sphere), and whether
    it is a ``bores`` face, with the outside toward the axis.
    """

    name: str
    kind: str
    faces: tuple[int, ...] = ()
    takes: tuple[str, ...] = ()
    points: int = 0
    contact: float = 1.0
    inside: float = 0.0
    rms: float = 0.0
    nominal: tuple[float, ...] = ()
    measured: tuple[float, ...] = ()
    shapes: tuple[str, ...] = ()
    places: tuple[Vector, ...] = ()
    axes: tuple[Vector, ...] = ()
    bores: tuple[bool, ...] = ()
    _ranges: ClassVar[dict[str, Range]] = {
        "points": (0, MOST), "contact": (0.0, 1.0), "inside": (0.0, 1.0), "rms": (0.0, MOST),
    }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Pose(Checked):
    """``T_part_scan`` (4,4), rigid. ``rms`` of the inliers' distance to the part, ``inliers`` their share of the scan.

    ``alternatives`` (K,4,4) are other poses that fit the scan equally well, as on a symmetric part: then the pose is
    one of several right ones. ``notes`` say so in words. ``doubts``: what speaks against the pose, and so against every
    site, as a small share of the scan on the part. Of those with the code `other_poses`, that poses fit which are no
    symmetries, only sites are concerned whose metal is another one in them.
    ``free``: motions that unworn skin does not exclude. ``is_held``: whether skin without wear holds the pose but for
    those; False where that was not tested.
    ``datums``: how the datums of a datum system were fitted, and ``left``: motions that they leave free and that the
    rest of the skin fixes, without a range. ``spread`` (6,K): the errors of a pose by datums, as columns of one
    standard deviation each: rotation about the middle of the part's bounds, in radians, then shift, in the job's unit;
    None where the pose was fitted to all of the skin.
    """

    T_part_scan: Floats
    rms: float = 0.0
    inliers: float = 1.0
    alternatives: Floats | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[Reason, ...] = ()
    free: tuple[FreeMotion, ...] = ()
    is_held: bool = False
    datums: tuple[DatumFit, ...] = ()
    left: tuple[FreeMotion, ...] = ()
    spread: Floats | None = None
    _dtypes: ClassVar[dict[str, Any]] = {"T_part_scan": np.float64, "alternatives": np.float64, "spread": np.float64}
    _ranges: ClassVar[dict[str, Range]] = {"rms": (0.0, MOST), "inliers": (0.0, 1.0)}

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("T_part_scan", self.T_part_scan, 4, 4)
        require_rigid("T_part_scan", self.T_part_scan)
        if self.alternatives is not None:
            require_shape("alternatives", self.alternatives, "K", 4, 4)
            require_rigid("alternatives", self.alternatives)
        if self.spread is not None:
            require_shape("spread", self.spread, 6, "K")
            require_finite("spread", self.spread)


@dataclass(frozen=True, eq=False)
class Deviation(Checked):
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
        require_shape("distance", self.distance, "N")
        require_shape("face", self.face, len(self.distance))
        require_shape("label", self.label, len(self.distance))
        require_finite("distance", self.distance)
        require_index("label", self.label, OUTLIER + 1, "labels")
        if len(self.face) and self.face.min() < 0:
            raise ArtefactError(f"face: expected numbers of triangles, got {self.face.min()}")


@dataclass(frozen=True, eq=False)
class Sites(Checked):
    """``label`` (N,) int32 per scan point: the number of its site from 1 up, 0 for a point of none. ``count`` sites."""

    label: NDArray[np.int32]
    count: int
    notes: tuple[str, ...] = ()
    _dtypes: ClassVar[dict[str, Any]] = {"label": np.int32}
    _ranges: ClassVar[dict[str, Range]] = {"count": (0, MOST)}

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("label", self.label, "N")
        if len(self.label) and not 0 <= self.label.min() <= self.label.max() <= self.count:
            raise ArtefactError(
                f"label: expected 0 to {self.count}, the count of sites, got {self.label.min()} to {self.label.max()}"
            )

    def members(self, site: int) -> Ints:
        """Indices of the scan points of one site."""
        return np.flatnonzero(self.label == site)
