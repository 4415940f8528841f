"""Selects few good poses from many rough ones; all are refined and scored at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.geometry.threads import cut_evenly, map_in_threads
from damageest.geometry.transforms import make_motions
from damageest.stages.align.surface.oriented_points import OrientedPoints, draw_by_direction
from damageest.stages.align.surface.plane_grid import Floats32, PlaneGrid

CHUNK = 200_000
"""Number of points that a thread looks up at once, to limit memory."""
KEPT = (12_000, 2000)
"""Poses that are left after the first and after the second look, each at more points."""


def score(poses: Floats, scan: OrientedPoints, field: PlaneGrid, band: float) -> Floats:
    """How well each of the poses (H,4,4) explains the scan, (H,): 1 where all points lie on the surface.

    A point within ``band`` of the surface, with a normal that agrees, adds up to 1, the more the closer. A point inside
    the part may be damage and adds 0. A point outside subtracts up to 0.7: damage does not explain it.
    """

    def score_some(some: Floats) -> Floats:
        _, offset, near, agree, distance = _look_up(some, scan, field, band)
        good = np.maximum(1 - (offset / band) ** 2, 0) * agree * near
        bad = np.clip((distance - band) / (2 * band), 0, 1)
        return np.asarray((good - 0.7 * bad).mean(1, dtype=np.float64))

    return np.concatenate(map_in_threads(score_some, _split(poses, len(scan.points))))


def refine(poses: Floats, scan: OrientedPoints, field: PlaneGrid, bands: Floats) -> Floats:
    """Robust point-to-plane steps, one per entry of ``bands``, for all poses (H,4,4) at once.

    Weights are Tukey's, 0 beyond the band, so that points on damage have no weight.
    """

    def refine_some(some: Floats) -> Floats:
        for band in bands:
            moved, offset, near, agree, index = _look_up(some, scan, field, float(band), planes=True)
            weight = np.maximum(1 - (offset / np.float32(band)) ** 2, 0) ** 2 * agree * near
            normal = field.plane[index][..., :3]
            jacobian = np.concatenate([np.cross(moved, normal), normal], axis=2)
            weighted = jacobian * weight[..., None]
            hessian = (np.swapaxes(weighted, 1, 2) @ jacobian).astype(np.float64)
            gradient = (np.swapaxes(weighted, 1, 2) @ offset[..., None]).astype(np.float64)
            damping = 1e-3 * len(scan.points) * np.diag([0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
            some = make_motions(-np.linalg.solve(hessian + damping, gradient)[..., 0]) @ some
        return some

    return np.concatenate(map_in_threads(refine_some, _split(poses, 4 * len(scan.points))))


def _split(poses: Floats, cost: int) -> list[Floats]:
    """The poses (H,4,4) in pieces that look up at most `CHUNK` points, where one pose looks up ``cost`` of them."""
    return [poses[own] for own in cut_evenly(len(poses), max(1, CHUNK // cost))]


def select_distinct(poses: Floats, scores: Floats, apart: float, wanted: int) -> Ints:
    """Indices of the at most ``wanted`` best poses, best first; none is within ``apart`` of a better one.

    The distance of two poses is the rms over the corners of a cube as large as the part.
    """
    corner = np.array([[x, y, z, 1.0] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (-0.3, 0.3)])
    # Compared by the inverse poses, which move the corners from the part's frame to the scan's.
    where = (np.linalg.inv(poses)[:, :3] @ corner.T).reshape(len(poses), -1) / np.sqrt(len(corner))
    chosen: list[int] = []
    left = np.argsort(-scores, kind="stable")
    while len(left) and len(chosen) < wanted:
        chosen.append(int(left[0]))
        left = left[((where[left] - where[left[0]]) ** 2).sum(1) > apart**2]
    return np.array(chosen, np.int64)


def _look_up(
    poses: Floats, scan: OrientedPoints, field: PlaneGrid, band: float, planes: bool = False
) -> tuple[Floats32, Floats32, NDArray[np.bool_], Floats32, NDArray[Any]]:
    """Looks the scan's M points up in the grid, moved by each of H poses.

    Returns:
        The moved points (H,M,3), their signed distances to the nearest plane (H,M), whether that plane is near, how
        well the normals agree (0 to 1), and the signed distances of the cells, or with ``planes`` the cells' numbers.
    """
    turn = np.swapaxes(poses[:, :3, :3], 1, 2).astype(np.float32)
    moved = scan.points.astype(np.float32) @ turn + poses[:, None, :3, 3].astype(np.float32)
    facing = scan.normals.astype(np.float32) @ turn
    index = field.find_cell(moved)
    plane = field.plane[index]
    offset = np.einsum("hmk,hmk->hm", moved, plane[..., :3]) + plane[..., 3]
    distance = field.distance[index]
    cosine = np.einsum("hmk,hmk->hm", facing, plane[..., :3])
    agree = np.clip((cosine if scan.signed else np.abs(cosine)) * 2 - 0.8, 0, 1)
    return moved, offset, np.abs(distance) < band + field.cell, agree, index if planes else distance


def search(
    poses: Floats, scan: OrientedPoints, field: PlaneGrid, rng: np.random.Generator, kept: tuple[int, int] = KEPT
) -> Floats:
    """Refines and selects: at most 80 poses (K,4,4), best first, from the rough ``poses`` (H,4,4)."""
    fewest, few, some, many = (draw_by_direction(scan, count, rng) for count in (30, 100, 250, 600))
    poses = poses[np.argsort(-score(poses, fewest, field, 0.05), kind="stable")[: kept[0]]]
    poses = poses[np.argsort(-score(poses, few, field, 0.05), kind="stable")[: kept[1]]]
    # A coarse step may be drawn to a large fracture that is nearly parallel to the skin: the poses before it stay too.
    poses = np.concatenate([refine(poses, few, field, np.array([0.06, 0.05, 0.04, 0.03])), poses])
    poses = poses[select_distinct(poses, score(poses, some, field, 0.03), 0.03, 400)]
    poses = refine(poses, some, field, np.geomspace(0.04, 0.012, 5))
    poses = poses[select_distinct(poses, score(poses, many, field, 0.012), 0.015, 80)]
    poses = refine(poses, many, field, np.geomspace(0.015, 0.006, 5))
    return poses[np.argsort(-score(poses, many, field, 0.008), kind="stable")]
