"""No alignment: for scans in the part's frame, or in a known pose."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Floats, Part, Pose, Scan
from damageest.errors import StageError
from damageest.geometry.transforms import move_points
from damageest.stages.align import Align
from damageest.stages.align.surface.frame import RigidPose


class KnownPose(Align):
    """Uses the given pose, by default the identity, and fits nothing.

    Refuses a pose in which the scan does not lie on the part, or fits much worse than nearby.
    """

    use: Literal["none"] = "none"
    gives_fitted_pose: ClassVar[bool] = False
    T_part_scan: RigidPose | None = Option(
        None,
        description="the pose T_part_scan, 4x4, from the scan's frame to the part's, in the job's unit; default: "
        "identity",
    )

    @property
    def known_pose(self) -> Floats:
        return np.eye(4) if self.T_part_scan is None else np.array(self.T_part_scan)

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The given pose; its inliers are the scan points within the tolerance of the part, of about 100,000 at
        most. Raises StageError where the scan contradicts it."""
        from damageest.stages.align._check_given import check_given
        from damageest.stages.align.surface.frame import MIN_POINTS
        from damageest.stages.align.surface.plane_grid import PartSurface

        T = self.known_pose
        if not len(scan.points):
            return Pose(T, inliers=0.0, notes=("the scan has no points",))
        if not np.isfinite(scan.points).all():
            raise StageError("the scan has points that are not finite", "remove these points from the file")
        # fewer points show no pose to compare the given one with
        doubts = check_given(T, scan, part, tolerance) if len(scan.points) >= MIN_POINTS else ()
        points = scan.points[:: max(1, len(scan.points) // 100_000)]
        distance = PartSurface(part, part.unseen).closest(move_points(points, T))[0]
        hit = np.abs(distance) <= tolerance
        rms = float(np.sqrt((distance[hit] ** 2).mean())) if hit.any() else 0.0
        return Pose(T, rms, float(hit.mean()), notes=tuple(map(str, doubts)), doubts=doubts)
