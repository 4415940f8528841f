"""Where a scan lies on the part: its pose, the datums that it was fitted to, and motions that nothing fixes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from damageest.artefacts.arrays import Floats, Vector
from damageest.artefacts.fields import MOST, ArtefactError, Checked, Range, require_finite, require_shape
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
    """A motion that unworn skin leaves free: after it the scan fits the part as well.

    ``direction``: unit vector of a shift, or of the axis of a turn through ``point`` (None: a shift), in the part's
    frame. ``low``, ``high``: ends of the motion, in the job's unit, 0 being the pose found; of a turn, the movement of
    the skin that moves most. ``turn``: angle in radians for each unit of it, 0 for a shift. ``text``: the same as text.
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

    ``name``: its letter. ``kind``: its shape, for example "plane", or "3 cylinders" for a pattern. ``faces``: numbers
    of its CAD faces, empty where the part is a mesh. ``takes``: the degrees of freedom that it fixes, as text in the
    part's frame. ``points``: scan points on it; ``contact``: the share of them on the fitted shape, ``inside``: below
    it, for example by wear. ``rms``: of the means of patches in contact, in the job's unit. ``nominal`` and
    ``measured``: the radius of each cylinder and sphere, in the job's unit. ``shapes``: the kind of each of its shapes,
    with ``places`` on it (a plane's middle, on the axis, the apex, the centre), ``axes`` (a plane's outward normal; 0
    for a sphere), and whether it is a ``bores`` face, with the outside toward the axis.
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

    ``alternatives`` (K,4,4) are other poses that fit the scan equally well, for example on a symmetric part: then the
    pose is one of several right ones, and ``notes`` say so. ``doubts``: reasons against the pose, and so against every
    site, for example a small share of the scan on the part. Of those with the code `other_poses`, that poses fit which
    are no symmetries, only sites are concerned whose metal is another one in them. ``free``: motions that unworn skin
    leaves free. ``is_held``: whether skin without wear holds the pose but for those; False where that was not tested.
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
