"""Whether a scan shows the mirror image of the part, as a left-hand part scanned for a right-hand one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.geometry.transforms import move_points
from damageest.stages.align._check_pose import DOUBTFUL_AGREEMENT, PoseCheck, check_pose
from damageest.stages.align._choose import COARSE
from damageest.stages.align._field import PartSurface, PlaneGrid
from damageest.stages.align._fine import Fit, fit
from damageest.stages.align._pairs import propose_poses
from damageest.stages.align._points import OrientedPoints, orient_surface
from damageest.stages.align._prepare_part import PreparedPart
from damageest.stages.align._search import search

POINTS = 2500
"""Number of scan points that mirrored poses are compared with."""

STEP = 5.0
"""Angle between the mirror planes that are tried, in degrees."""

FITTED = 3
"""Number of mirror planes whose poses are fitted."""

LESS, LARGE_GAIN = 0.6, 0.04
"""For the mirrored scan to be the better one: the share of the points off the part that it may keep, or the share of
the points near the part that lies on it only where the scan is mirrored."""

SUSPECT = 0.82
"""Share of the points near the part on its surface below which a mirrored scan is searched for from the beginning."""

MIN_GAIN = 0.015
"""Least such share in any case. Where less of the scan is off the part, it is not searched for mirrored."""

SYMMETRIC, NEAR = 0.005, 0.004
"""Share of the part's surface that a reflection may take off it, by more than the second, for the part to be symmetric:
then a scan and its mirror image show the same."""


def fit_reflections(target: PartSurface, field: PlaneGrid, points: Floats, best: Fit, noise: float) -> Fit:
    """The best fit of the points (N,3), mirrored from their pose ``best`` at planes through the part's middle that
    contain one of its axes. The ``pose`` of the result mirrors.

    A part that nearly has such a plane of symmetry fits its mirror image nearly as well; its holes and bosses do not.
    """
    at = move_points(points[:POINTS], best.pose)
    few = at[:1500]
    mirrors = _make_reflections()
    on = [
        float((np.abs(field.distance[field.find_cell(move_points(few, mirror).astype(np.float32))]) < COARSE).mean())
        for mirror in mirrors
    ]
    fits = []
    for k in np.argsort(-np.array(on), kind="stable")[:FITTED]:
        one = fit(target, move_points(at, mirrors[k]), np.eye(4), 3 * COARSE, noise, 30)
        fits.append(Fit(one.pose @ mirrors[k] @ best.pose, one.band, one.residue))
    return max(fits, key=lambda one: _measure_share_on(target, points[:POINTS], one.pose, best.band))


def search_mirrored(
    part: PreparedPart, scan: OrientedPoints, points: Floats, noise: float, trials: int, rng: np.random.Generator
) -> Fit:
    """The best fit of the mirrored scan, searched for from the beginning. The ``pose`` of the result mirrors.

    ``scan``: oriented points of it; ``points`` (N,3): for the fit; ``trials``: number of candidate poses.
    """
    flip = np.array([1.0, 1.0, -1.0])
    mirrored = OrientedPoints(scan.points * flip, scan.normals * flip, scan.signed)
    pose = search(propose_poses(mirrored, part.pairs, trials, rng), mirrored, part.grid, rng)[0]
    found = fit(part.surface, points * flip, pose, COARSE, noise, 30)
    return replace(found, pose=found.pose @ np.diag([*flip, 1.0]))


def _make_reflections() -> Floats:
    """Reflections (K,4,4) at planes that contain one of the coordinate axes."""
    angle = np.radians(np.arange(0, 180, STEP))
    normals = [np.roll(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), k, axis=1) for k in range(3)]
    normal = np.concatenate(normals)
    result = np.tile(np.eye(4), (len(normal), 1, 1))
    result[:, :3, :3] -= 2 * normal[:, :, None] * normal[:, None, :]
    return result


def _measure_share_on(target: PartSurface, points: Floats, pose: Floats, band: float) -> float:
    return float((np.abs(target.closest(move_points(points, pose))[0]) < band).mean())


def refuse_mirrored(
    target: PartSurface,
    points: Floats,
    raw: Floats,
    pose: Floats,
    best: PoseCheck,
    mirrored: Fit,
    tolerance: float,
) -> None:
    """Raises StageError where the scan fits clearly better when mirrored.

    ``pose`` (4,4): its best pose; ``best``: the check of that; ``mirrored``: a pose that mirrors; ``points`` and
    ``raw`` as for `check_pose`.
    """
    surface = orient_surface(target.mesh, 4000, np.random.default_rng(0)).points
    surface = move_points(surface, mirrored.pose @ np.linalg.inv(pose))
    # Fitted: the reflection of a scan with damage is inexact, and the part may be symmetric by one nearby.
    onto = fit(target, surface, np.eye(4), 3 * COARSE, 1e-5, 30).pose
    off = np.abs(target.closest(move_points(surface, onto))[0]) > NEAR
    if off.mean() < SYMMETRIC:
        return
    check = check_pose(target, mirrored, points, raw, tolerance)
    gain = check.agreement - best.agreement
    if not check.is_acceptable:  # another part altogether
        return
    if gain > LARGE_GAIN or (gain > MIN_GAIN and 1 - check.agreement < LESS * (1 - best.agreement)):
        if check.agreement < DOUBTFUL_AGREEMENT:
            raise StageError(
                f"in the best pose only {best.agreement:.0%} of what the scan shows near the part lies on its surface, "
                f"and {check.agreement:.0%} of it if it were mirrored: it shows a mirrored part, another size, a "
                "bent one, or another part",
                "scan: {scale: auto} if the scale may be wrong; otherwise check which part was scanned",
            )
        raise StageError(
            f"the scan is a mirror image of the part: {check.agreement:.0%} of what it shows near the part would lie "
            f"on its surface if it were mirrored, {best.agreement:.0%} does in the best pose",
            "check for a left-hand and a right-hand version of the part, and for an axis that an export reversed",
        )
