"""A scan, and what its points are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts.arrays import Bytes, Flags, Floats, Ints, Singles
from damageest.artefacts.fields import MOST, ArtefactError, Checked, Range, require_finite, require_index, require_shape
from damageest.artefacts.meshes import Solid
from damageest.artefacts.poses import require_rigid
from damageest.artefacts.reasons import Reason

INTACT, DAMAGE, ADDED, OUTLIER = 0, 1, 2, 3
"""Labels of a scan point: on the nominal surface; on an inner damage surface; outside the part by more than the
tolerance (weld bead, dirt, fixture); deviating, but in no site (noise)."""


OF_POINTS = ("points", "normals", "view", "cloud", "colours", "confidence")
"""Fields of a scan, or of a file of points, with a row for each point."""

P = TypeVar("P")

MOST_CLOUDS = 1 << 30


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

    ``noise``, and ``spacing``, a median of distances to the nearest neighbours, are 0 until measured. ``viewpoints``
    (V,3): where the scanner stood for each view, in the frame of the points; ``view`` (N,): the number of each point's
    view, -1 where its scanner position is not known. Both None where no position is known. ``cloud`` (N,): the number
    of the cloud of each point, for example of its file: the points of one cloud do not move against each other, whether
    its scanner position is known or not; -1 where that is not known. None: a view is a cloud. ``total``: number of
    points in the files where only some of them are here, else 0. ``colours`` (N,3) from 0 to 255, and ``confidence``
    (N,) on the scale of the files, as the scanner's program wrote them; None where no file has them. Beside files with,
    the points of a file without are grey, and their confidence is no number. ``warnings``: what the reader doubts.
    ``columns``: which columns of text files are x, y and z, and why, where it is not plain.
    """

    points: Floats
    normals: Floats | None = None
    unit: str = "mm"
    paths: tuple[str, ...] = ()
    noise: Annotated[float, "measured standard deviation of the points off the local surface"] = 0.0
    spacing: Annotated[float, "measured distance that a reconstructed surface has to bridge"] = 0.0
    truth: Truth | None = None
    notes: tuple[str, ...] = ()
    viewpoints: Floats | None = None
    view: NDArray[np.int32] | None = None
    total: int = 0
    colours: Bytes | None = None
    confidence: Singles | None = None
    warnings: tuple[Reason, ...] = ()
    cloud: NDArray[np.int32] | None = None
    columns: tuple[str, ...] = ()
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
