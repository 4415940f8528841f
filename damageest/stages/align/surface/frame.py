"""Scan and part, centred and scaled so that the diagonal of the part is 1; and the option for a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from damageest.artefacts import Floats, Mesh, Part, Scan
from damageest.errors import StageError
from damageest.stages.align.surface.plane_grid import PartSurface

MIN_POINTS = 200
"""Number of scan points that an alignment needs."""

Row = tuple[float, float, float, float]


def _check_rigid(rows: tuple[Row, Row, Row, Row]) -> tuple[Row, Row, Row, Row]:
    T = np.array(rows)
    if not np.isfinite(T).all() or np.abs(T[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise ValueError("not a pose: its numbers must be finite and its last row 0, 0, 0, 1")
    if np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-6:
        raise ValueError("not rigid: the upper left 3x3 must be a rotation, without scale or shear")
    if np.linalg.det(T[:3, :3]) < 0:
        raise ValueError("not rigid: the upper left 3x3 mirrors (its determinant is -1)")
    return rows


RigidPose = Annotated[tuple[Row, Row, Row, Row], AfterValidator(_check_rigid)]
"""A 4x4 pose as an option: four rows of four numbers, checked to be rigid."""


@dataclass(frozen=True)
class Frame:
    """The scaled part, ``target``, and the numbers to scale with: the part's ``size`` (its diagonal) and ``centre``
    (3,), and the scan's ``middle`` (3,)."""

    target: PartSurface
    size: float
    centre: Floats
    middle: Floats

    @classmethod
    def build(cls, scan: Scan, part: Part, known: Floats | None = None) -> Frame:
        """``known``: the pose (4,4), where the scan may show a piece of the part.

        Raises StageError for a scan of too few or non-finite points, or of a size that cannot be the part's.
        """
        from damageest.geometry.pieces_of_part import is_piece
        from damageest.geometry.units import diagnose_scale

        if len(scan.points) < MIN_POINTS:
            raise StageError(
                f"the scan has {len(scan.points)} points; an alignment needs at least {MIN_POINTS}",
                "give a denser scan; where the pose is known, give it to align: none",
                topic="sparse",
            )
        if not np.isfinite(scan.points).all():
            raise StageError("the scan has points that are not finite", "remove these points from the file")
        wrong = diagnose_scale(scan.points, part.vertices, part.unit)
        if wrong and not (known is not None and is_piece(scan.points, part, known)):
            raise StageError(wrong, "set the unit of scan or part, or crop the scan to the part", topic="unit")
        size, centre = part.diagonal, part.bounds.mean(0)
        middle = np.median(scan.points[:: max(1, len(scan.points) // 100_000)], axis=0)
        scaled = Mesh((part.vertices - centre) / size, part.faces)
        return cls(PartSurface(scaled, part.unseen, part, size), size, centre, middle)

    def scale_points(self, scan: Scan) -> Floats:
        """The scan's points (N,3), centred, in diagonals of the part."""
        return (scan.points - self.middle) / self.size

    def scale_pose(self, T: Floats) -> Floats:
        """A pose (4,4) in the job's unit as a pose of the scaled scan and part."""
        pose = np.eye(4)
        pose[:3, :3] = T[:3, :3]
        pose[:3, 3] = (T[:3, 3] + T[:3, :3] @ self.middle - self.centre) / self.size
        return pose

    def unscale_pose(self, pose: Floats) -> Floats:
        """The inverse of `scale_pose`; the rotation is made orthonormal, since rounding errors of many steps add up."""
        u, _, v = np.linalg.svd(pose[:3, :3])
        T = np.eye(4)
        T[:3, :3] = u @ v
        T[:3, 3] = pose[:3, 3] * self.size + self.centre - T[:3, :3] @ self.middle
        return T
