"""Where a scan lies on the part: its pose, the datums that it was fitted to, and motions that nothing fixes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from damageest.artefacts.arrays import Floats, Vector
from damageest.artefacts.fields import ArtefactError, Checked, Count, NotNegative, Shape, Share, require_finite
from damageest.artefacts.reasons import Reason

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


@dataclass(frozen=True)
class FreeMotion(Checked):
    """A motion that unworn skin leaves free: after it the scan fits the part as well. ``low`` and ``high`` are measured
    from the pose that was found."""

    direction: Annotated[Vector, "direction of a shift, or of the axis of a turn; unit vector in the part's frame"]
    low: Annotated[
        float, "lower end of the motion, in the job's unit; of a turn: movement of the skin farthest from the axis"
    ]
    high: Annotated[float, "upper end of the motion, in the same"]
    point: Annotated[Vector | None, "a point on the axis of a turn; null for a shift"] = None
    turn: Annotated[float, "angle in radians for each unit of movement; 0 for a shift"] = 0.0
    text: str = ""

    def move(self, points: Floats) -> Floats:
        """How points (N,3) of the scan, in the part's frame, move for each unit of the motion (N,3)."""
        if self.point is None:
            return np.tile(np.array(self.direction), (len(points), 1))
        return np.cross(self.turn * np.array(self.direction), points - np.array(self.point))


@dataclass(frozen=True, eq=False)
class DatumFit(Checked):
    """How one datum of a datum system was fitted to the scan, in the order of precedence.

    ``shapes``: the kind of each of its shapes, with ``places`` on it (a plane's middle, on the axis, the apex, the
    centre), ``axes`` (a plane's outward normal; 0 for a sphere), and whether it is a ``bores`` face, with the outside
    toward the axis.
    """

    name: Annotated[str, "letter of the datum"]
    kind: Annotated[str, "shape, for example `plane`, or `3 cylinders` for a pattern"]
    faces: Annotated[tuple[int, ...], "numbers of its CAD faces; empty where the part is a mesh"] = ()
    takes: Annotated[tuple[str, ...], "degrees of freedom that it fixes beyond earlier datums"] = ()
    points: Annotated[Count, "scan points on it"] = 0
    contact: Annotated[Share, "share of them on the fitted shape"] = 1.0
    inside: Annotated[Share, "share of them below the fitted shape, for example by wear"] = 0.0
    rms: Annotated[NotNegative, "root mean square distance of patches in contact from the fitted shape"] = 0.0
    nominal: Annotated[tuple[float, ...], "radius of each cylinder and sphere, as designed"] = ()
    measured: Annotated[tuple[float, ...], "radius of each as fitted to the scan"] = ()
    shapes: tuple[str, ...] = ()
    places: tuple[Vector, ...] = ()
    axes: tuple[Vector, ...] = ()
    bores: tuple[bool, ...] = ()


@dataclass(frozen=True, eq=False)
class Pose(Checked):
    """``T_part_scan`` (4,4), rigid. ``alternatives`` (K,4,4): with them the pose is one of several right ones, and
    ``notes`` say so.

    Of ``doubts`` with the code `other_poses`, that poses fit which are no symmetries, only sites are concerned whose
    metal is another one in them. ``is_held``: False where that was not tested. ``left``: motions without a range.
    ``spread`` (6,K): the errors of a pose by datums, as columns of one standard deviation each: rotation about the
    middle of the part's bounds, in radians, then shift, in the job's unit; None where the pose was fitted to all of the
    skin.
    """

    T_part_scan: Annotated[Floats, Shape(4, 4)]
    rms: Annotated[NotNegative, "root mean square distance of the inliers to the part"] = 0.0
    inliers: Annotated[Share, "share of the scan's points"] = 1.0
    alternatives: Annotated[
        Floats | None, Shape("K", 4, 4), "other poses that fit as well, for example on a symmetric part"
    ] = None
    notes: tuple[str, ...] = ()
    doubts: Annotated[tuple[Reason, ...], "reasons against the pose, and so against every site"] = ()
    free: Annotated[tuple[FreeMotion, ...], "motions that no unworn skin fixes"] = ()
    is_held: Annotated[bool, "whether unworn skin fixes all other motions"] = False
    datums: Annotated[tuple[DatumFit, ...], "datums of a datum system, in the order of precedence; else empty"] = ()
    left: Annotated[tuple[FreeMotion, ...], "motions that the datum system leaves free, fixed by other skin"] = ()
    spread: Annotated[Floats | None, Shape(6, "E")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_rigid("T_part_scan", self.T_part_scan)
        if self.alternatives is not None:
            require_rigid("alternatives", self.alternatives)
