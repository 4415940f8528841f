"""No alignment: for scans in the part's frame, or in a known pose."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align import Align
from damageest.stages.align._frame import RigidPose


class KnownPose(Align):
    """Uses the given pose, by default the identity, and fits nothing.

    The result tells how well the scan lies on the part in that pose.
    """

    use: Literal["none"] = "none"
    T_part_scan: RigidPose | None = Option(
        None,
        description="the pose T_part_scan, 4x4, from the scan's frame to the part's, in the job's unit; default: "
        "identity",
    )

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The given pose; its inliers are the scan points within the tolerance of the part, of about 100,000 at
        most."""
        from damageest.stages.align._field import PartSurface

        T = np.eye(4) if self.T_part_scan is None else np.array(self.T_part_scan)
        if not len(scan.points):
            return Pose(T, inliers=0.0, notes=("the scan has no points",))
        if not np.isfinite(scan.points).all():
            raise StageError("the scan has points that are not finite", "remove these points from the file")
        points = scan.points[:: max(1, len(scan.points) // 100_000)]
        distance = PartSurface(part).closest(points @ T[:3, :3].T + T[:3, 3])[0]
        hit = np.abs(distance) <= tolerance
        rms = float(np.sqrt((distance[hit] ** 2).mean())) if hit.any() else 0.0
        share = float(hit.mean())
        doubt = f"only {share:.0%} of the scan points lie on the part in the given pose; check T_part_scan"
        return Pose(T, rms, share, notes=() if share >= 0.35 else (doubt,))
