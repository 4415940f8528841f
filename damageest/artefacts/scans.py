"""A scan, and what its points are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts.arrays import Bytes, Flags, Floats, Ints, Singles
from damageest.artefacts.fields import ArtefactError, Checked, Count, NotNegative, Shape, require_index
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
    T_part_scan: Annotated[Floats, Shape(4, 4)]
    added: Solid | None = None
    deformed: Solid | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
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

    points: Annotated[Floats, Shape("N", 3, finite=False)]
    normals: Annotated[Floats | None, Shape("N", 3, finite=False)] = None
    unit: str = "mm"
    paths: tuple[str, ...] = ()
    noise: Annotated[NotNegative, "measured standard deviation of the points off the local surface"] = 0.0
    spacing: Annotated[NotNegative, "measured distance that a reconstructed surface has to bridge"] = 0.0
    truth: Truth | None = None
    notes: tuple[str, ...] = ()
    viewpoints: Annotated[Floats | None, Shape("V", 3)] = None
    view: Annotated[NDArray[np.int32] | None, Shape("N")] = None
    total: Count = 0
    colours: Annotated[Bytes | None, Shape("N", 3)] = None
    confidence: Annotated[Singles | None, Shape("N", finite=False)] = None
    warnings: tuple[Reason, ...] = ()
    cloud: Annotated[NDArray[np.int32] | None, Shape("N")] = None
    columns: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.viewpoints is None) != (self.view is None):
            raise ArtefactError("viewpoints and view: give both or none")
        if self.viewpoints is not None and self.view is not None:
            require_index("view", self.view, len(self.viewpoints), "viewpoints", least=-1)
        if self.cloud is not None:
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

    points: Annotated[Floats, Shape("N", 3)]
    normals: Annotated[Floats, Shape("N", 3)]
    face: Annotated[Ints, Shape("N")]
    kind: Annotated[NDArray[np.uint8], Shape("N")]
    spacing: NotNegative

    def __post_init__(self) -> None:
        super().__post_init__()
        require_index("kind", self.kind, 3, "kinds")
        if len(self.face) and self.face.min() < 0:
            raise ArtefactError(f"face: expected numbers of triangles, got {self.face.min()}")


@dataclass(frozen=True, eq=False)
class Deviation(Checked):
    """Per scan point, in the part's frame: ``distance`` (N,) signed to the part's surface, positive outside; ``face``
    (N,) the nearest triangle; ``label`` (N,), one of INTACT, DAMAGE, ADDED, OUTLIER. ``notes`` say what the scan
    does not show."""

    distance: Annotated[Floats, Shape("N")]
    face: Annotated[Ints, Shape("N")]
    label: Annotated[NDArray[np.uint8], Shape("N")]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        require_index("label", self.label, OUTLIER + 1, "labels")
        if len(self.face) and self.face.min() < 0:
            raise ArtefactError(f"face: expected numbers of triangles, got {self.face.min()}")


@dataclass(frozen=True, eq=False)
class Sites(Checked):
    """``label`` (N,) int32 per scan point: the number of its site from 1 up, 0 for a point of none. ``count`` sites."""

    label: Annotated[NDArray[np.int32], Shape("N")]
    count: Count
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.label) and not 0 <= self.label.min() <= self.label.max() <= self.count:
            raise ArtefactError(
                f"label: expected 0 to {self.count}, the count of sites, got {self.label.min()} to {self.label.max()}"
            )

    def members(self, site: int) -> Ints:
        """Indices of the scan points of one site."""
        return np.flatnonzero(self.label == site)
