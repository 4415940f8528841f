"""Whether a fitted pose explains the scan at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.stages.align._field import PartSurface
from damageest.stages.align._fine import Fit, move_points
from damageest.stages.align._points import draw_stratified, orient_surface

MIN_ON_PART, MIN_ON_PART_IF_COVERED, MIN_COVER = 0.38, 0.15, 0.45
"""The share of the scanned area that must lie on the part; less will do where that much of the part's surface is
covered, as when the part stands on a fixture that was scanned along."""

CHECKED_POINTS = 15_000
"""Points that each share is counted on: right to half a percent."""


@dataclass(frozen=True)
class PoseCheck:
    """Shares of the scanned area ``on`` the part's surface, ``inside`` it and ``outside``; ``cover``: the share of the
    part's surface near points that lie on it; ``rms`` of the inliers' distance, ``inliers`` their share by number."""

    on: float
    inside: float
    outside: float
    cover: float
    rms: float
    inliers: float

    @property
    def is_acceptable(self) -> bool:
        return self.on >= MIN_ON_PART or (self.on >= MIN_ON_PART_IF_COVERED and self.cover >= MIN_COVER)

    def build_error(self, remedy: str) -> StageError:
        return StageError(
            f"no pose found that explains the scan: at best {self.on:.0%} of the scanned surface lies on the part "
            f"(with {self.inside:.0%} inside it and {self.outside:.0%} outside), covering {self.cover:.0%} of the "
            f"part's; at least {MIN_ON_PART:.0%} should lie on it",
            remedy,
        )


def check_pose(target: PartSurface, best: Fit, even: Floats, raw: Floats, tolerance: float) -> PoseCheck:
    """``even`` (N,3): points spread evenly over the scanned area; ``raw`` (M,3): any unbiased subset; in diagonals.

    A point counts as on the surface within the tolerance, or within the fit's own band where noise makes that wider.
    """
    from scipy.spatial import cKDTree

    band = max(tolerance, min(best.band, 0.004))
    rng = np.random.default_rng(0)
    even, raw = (points[draw_stratified(len(points), CHECKED_POINTS, rng)] for points in (even, raw))
    at = move_points(best.pose, even)
    distance = target.closest(at)[0]
    on = np.abs(distance) <= band
    surface = orient_surface(target.mesh, 5000, np.random.default_rng(0)).points
    cover = 0.0
    if on.sum() > 10:
        gap = 3 * float(np.sqrt(target.mesh.area / len(even)))
        cover = float(np.isfinite(cKDTree(at[on]).query(surface, distance_upper_bound=max(gap, 0.02))[0]).mean())
    loose = target.closest(move_points(best.pose, raw))[0]
    hit = np.abs(loose) <= band
    rms = float(np.sqrt((loose[hit] ** 2).mean())) if hit.any() else float("inf")
    return PoseCheck(
        float(on.mean()),
        float((distance < -band).mean()),
        float((distance > band).mean()),
        cover,
        rms,
        float(hit.mean()),
    )
