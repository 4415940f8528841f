"""Whether the signs of a scan's normals can be believed, and what a pose says of them.

The contract says that normals point outward. Some programs write them inward, or each as it came: a search that
believes such signs finds a wrong pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Scan
from damageest.geometry.transforms import move_points
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.surface.oriented_points import OrientedPoints, draw_stratified
from damageest.stages.align.surface.plane_grid import PartSurface

ASKED = 10_000
"""Number of points whose normals are compared with those of the part."""
GRAZING = 0.2
"""Cosine of the angle between a normal and the way to the scanner below which its sign is not asked."""
KNOWN = 0.8
"""Share of the points whose scanner position has to be known before it can confirm the normals."""
WRONG = 0.03
"""Share of normals that point the wrong way from which signs are not believed, and from which it is told."""
PARALLEL = 0.8
"""Cosine of the angle between normals of scan and part above which their signs can be compared."""
ALONG, AGAINST = 0.1, 0.5
"""Share of normals pointing inward up to which they agree with a pose, and from which they contradict it."""


@dataclass(frozen=True)
class SignedNormals:
    """``normals`` (N,3) of a scan, or None, turned to the scanner where its position is known; ``is_proven``: whether
    such positions confirm them, and the file agrees."""

    normals: Floats | None
    is_proven: bool

    @classmethod
    def read(cls, scan: Scan) -> SignedNormals:
        """Those of a scan."""
        normals = scan.normals
        if normals is None or scan.view is None or scan.viewpoints is None or not len(normals):
            return cls(normals, False)
        known = np.flatnonzero(scan.view >= 0)
        way = scan.viewpoints[scan.view[known]] - scan.points[known]
        along = np.einsum("ij,ij->i", way, normals[known])
        clear = np.abs(along) > GRAZING * np.linalg.norm(way, axis=1) * np.linalg.norm(normals[known], axis=1)
        away = clear & (along < 0)
        if not away.any():
            return cls(normals, len(known) >= KNOWN * len(normals))
        turned = normals.copy()
        turned[known[away]] *= -1
        is_rare = float(away.sum()) < WRONG * float(clear.sum())
        return cls(turned, is_rare and len(known) >= KNOWN * len(normals))


def prefer_outward(target: PartSurface, scan: OrientedPoints, poses: Floats, band: float) -> Floats:
    """Those of the poses (K,4,4), which explain the scan equally well, that its normals do not contradict; all where
    the normals agree with none. The order stays."""
    inward = np.array([measure_inward(target, scan.points, scan.normals, pose, band) for pose in poses])
    return poses[inward < AGAINST] if inward.min() < ALONG else poses


def note_inward(target: PartSurface, frame: Frame, scan: Scan, best: Fit) -> tuple[str, ...]:
    """A note where normals of the scan's file point into the part in the pose ``best``; empty where few do."""
    if scan.normals is None:
        return ()
    index = draw_stratified(len(scan.points), ASKED, np.random.default_rng(0))
    inward = measure_inward(target, frame.scale_points(scan)[index], scan.normals[index], best.pose, best.band)
    if inward < WRONG:
        return ()
    return (
        f"the scan's normals point into the part at {inward:.0%} of the points on its skin: their signs were ignored; "
        "export the normals outward",
    )


def measure_inward(target: PartSurface, points: Floats, normals: Floats, pose: Floats, band: float) -> float:
    """Share of the points (N,3) on the part whose normals (N,3) point into it in ``pose`` (4,4); 0 where none can be
    compared."""
    distance, _, face = target.closest(move_points(points, pose))
    near = np.abs(distance) < band
    facing = np.einsum("ij,ij->i", normals[near] @ pose[:3, :3].T, target.normals[face[near]])
    clear = np.abs(facing) > PARALLEL * np.linalg.norm(normals[near], axis=1)
    return float((facing[clear] < 0).mean()) if clear.any() else 0.0
