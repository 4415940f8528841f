"""Checks whether a fitted pose explains the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Reason
from damageest.errors import StageError
from damageest.geometry.transforms import move_points
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.oriented_points import draw_stratified, orient_surface
from damageest.stages.align.surface.plane_grid import UNKNOWN, PartSurface

MIN_ON_PART, MIN_ON_PART_IF_COVERED, MIN_COVER = 0.38, 0.15, 0.45
"""Share of the scanned area that must lie on the part. The second, smaller share is enough where points cover
`MIN_COVER` of the part's surface, as when a fixture was scanned with the part."""

MIN_AGREEMENT, DOUBTFUL_AGREEMENT = 0.55, 0.72
"""Share on the surface of the scanned area that is on the part, inside it, or outside it by less than `NEAR`. In right
poses it was 0.74 or more with a third of the metal missing, with surroundings 0.79; with wrong parts 0.5 or less. Below
the first the pose is refused, below the second it is doubtful."""

MIN_AGREEMENT_INSIDE, MOST_BESIDE = 0.45, 0.01
"""The first is enough where the points cover `MIN_COVER` of the part's surface and no more than the second of them lie
outside it, but near: a part that lost a third of its metal at two large fractures. Wrong parts lie outside as well."""

NEAR = 0.05
"""Distance outside the part, in diagonals, from which a point shows something beside the part, such as a table."""

MIN_FACING = 0.2
"""Share of the scanned area that has to face skin, of a part that is an earlier scan: the shares are of that."""

CHECKED_POINTS = 15_000
"""Number of points that each share is estimated from; enough for half a percent."""


@dataclass(frozen=True)
class PoseCheck:
    """How well a pose explains a scan.

    ``on``, ``inside``, ``outside``: shares of the scanned area on the part's surface, inside the part and outside it;
    ``beside``: the share outside, but near it, which no damage explains.
    ``cover``: share of the part's surface that has scan points on it. ``rms``: of the distances of the inliers, the
    points on the surface. ``inliers``: their share of all scan points.
    """

    on: float
    inside: float
    outside: float
    beside: float
    cover: float
    rms: float
    inliers: float

    @property
    def agreement(self) -> float:
        """Share on the surface, of what is on the part, inside it or beside it."""
        return self.on / max(self.on + self.inside + self.beside, 1e-9)

    @property
    def is_acceptable(self) -> bool:
        """Whether enough of the scan lies on the part."""
        enough = self.on >= MIN_ON_PART or (self.on >= MIN_ON_PART_IF_COVERED and self.cover >= MIN_COVER)
        is_all_inside = self.beside <= MOST_BESIDE and self.cover >= MIN_COVER
        return enough and self.agreement >= (MIN_AGREEMENT_INSIDE if is_all_inside else MIN_AGREEMENT)

    def describe(self) -> str:
        """The shares in words."""
        return (
            f"{self.on:.0%} of the scanned surface lies on the part ({self.inside:.0%} inside it, {self.outside:.0%} "
            f"outside) and covers {self.cover:.0%} of the part's surface"
        )

    def note_doubts(self) -> tuple[Reason, ...]:
        """A doubt where the pose is acceptable, but little of the scan agrees with the part."""
        if self.agreement >= DOUBTFUL_AGREEMENT:
            return ()
        text = f"only {self.agreement:.0%} of the scan near the part lies on it: another part or revision?"
        return (
            Reason(
                "another_part", text, "contradicts", self.agreement, remedy="compare part and revision with the scan"
            ),
        )

    def build_error(self, remedy: str) -> StageError:
        """The error for a pose that is not acceptable."""
        return StageError(
            f"no pose found that explains the scan: in the best pose {self.describe()}; at least {MIN_ON_PART:.0%} "
            f"should lie on the part, and {MIN_AGREEMENT:.0%} of what is near it",
            remedy,
            topic="pose",
        )


def check_pose(target: PartSurface, best: Fit, even: Floats, raw: Floats, tolerance: float) -> PoseCheck:
    """Measures how well the pose of ``best`` explains the scan.

    ``even`` (N,3): points spread evenly over the scanned area, for shares of area; ``raw`` (M,3): any unbiased subset
    of the scan, for the inliers. All lengths in diagonals of the part. A point within the tolerance lies on the
    surface; where noise makes the band of the fit wider, a point within that band.
    """
    from scipy.spatial import cKDTree

    band = max(tolerance, min(best.band, 0.004))
    rng = np.random.default_rng(0)
    even, raw = (points[draw_stratified(len(points), CHECKED_POINTS, rng)] for points in (even, raw))
    at = move_points(even, best.pose)
    distance = target.closest(at)[0]
    faces_skin = distance > UNKNOWN
    share = float(faces_skin.mean())
    if share < MIN_FACING:
        return PoseCheck(0.0, 0.0, 1.0, 0.0, 0.0, float("inf"), 0.0)
    even, at, distance = even[faces_skin], at[faces_skin], distance[faces_skin]
    on = np.abs(distance) <= band
    surface = orient_surface(target.known, 5000, np.random.default_rng(0)).points
    cover = 0.0
    if on.sum() > 10:
        gap = 3 * float(np.sqrt(target.known.area / len(even)))
        cover = float(np.isfinite(cKDTree(at[on]).query(surface, distance_upper_bound=max(gap, 0.02))[0]).mean())
    raw_distance = target.closest(move_points(raw, best.pose))[0]
    raw_distance = raw_distance[raw_distance > UNKNOWN]
    hit = np.abs(raw_distance) <= band
    rms = float(np.sqrt((raw_distance[hit] ** 2).mean())) if hit.any() else float("inf")
    return PoseCheck(
        float(on.mean()),
        float((distance < -band).mean()),
        float((distance > band).mean()),
        float(((distance > band) & (distance < NEAR)).mean()),
        cover,
        rms,
        float(hit.mean()),
    )
