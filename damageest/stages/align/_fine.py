"""The robust fit of scan points to the part's exact triangles, and what is left over of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.stages.align._field import PartSurface
from damageest.stages.align._search import make_motion

REACH = 3.5
"""Where the kernel ends, in standard deviations of the points off the surface."""

MAX_DRIFT = 0.1
"""How far the points may move, in bands, before their closest points are looked up again: until then their planes do.
"""


@dataclass(frozen=True)
class Fit:
    """A fitted ``pose`` (4,4); ``band``: how far off the surface a point may be and still have had a say; ``residue``:
    by how much (rms) the last step still changed the points' distances from the surface."""

    pose: Floats
    band: float
    residue: float


def move_points(pose: Floats, points: Floats) -> Floats:
    return points @ pose[:3, :3].T + pose[:3, 3]


def fit(target: PartSurface, points: Floats, pose: Floats, band: float, noise: float, rounds: int) -> Fit:
    """Point-to-plane Gauss-Newton steps on the closest points of the triangles, weighted by Tukey's biweight.

    The kernel starts ``band`` wide and narrows to `REACH` standard deviations, measured on the points within it and at
    least ``noise``: at the end damage and dirt have no weight at all, where least squares would give them the most.
    All lengths in diagonals of the part.
    """
    narrowest = max(REACH * noise, 2e-5)
    step = residue = drift = np.inf
    for turn in range(rounds):
        at = move_points(pose, points)
        if drift > MAX_DRIFT * band:
            distance, foot, face = target.closest(at)
            if turn == 0:  # the pose will not move by more than a few bands: what is farther off need not be seen again
                close = np.abs(distance) < 4 * band
                points, at, distance, foot, face = points[close], at[close], distance[close], foot[close], face[close]
            normals, drift = target.normals[face], 0.0
            offset = np.einsum("ij,ij->i", normals, at - foot)
        else:
            before, offset = offset, np.einsum("ij,ij->i", normals, at - foot)
            distance = distance + offset - before
        within = np.abs(distance) < band
        if within.sum() < 12:
            break
        deviation = 1.4826 * float(np.median(np.abs(distance[within])))
        normal = normals[within]
        weight = (1 - (distance[within] / band) ** 2) ** 2
        twist, jacobian = solve_gauss_newton(at[within], normal, weight, offset[within])
        pose = make_motion(twist[None])[0] @ pose
        step = float(np.hypot(np.linalg.norm(twist[:3]) / 2, np.linalg.norm(twist[3:])))
        drift += step
        residue = float(np.sqrt(np.average((jacobian @ twist) ** 2, weights=weight + 1e-12)))
        narrower = min(band, max(REACH * deviation, 0.6 * band, narrowest))
        if step < 0.003 * narrowest and narrower > 0.97 * band:
            break
        band = narrower
    return Fit(pose, max(band, narrowest), residue)


def solve_gauss_newton(at: Floats, normals: Floats, weight: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """The twist (6,) that brings points (N,3) nearest to planes, from whose ``normals`` (N,3) and ``offset`` (N,) of
    the points, each with its ``weight`` (N,); and what each point's offset gains by it (N,6)."""
    jacobian = np.column_stack([np.cross(at, normals), normals])
    hessian = jacobian.T @ (jacobian * weight[:, None])
    # A little damping holds the motions that the surface does not fix, such as a shaft's turning.
    hessian += np.diag(np.full(6, 1e-6 * max(float(np.trace(hessian)), 1e-12)))
    return np.asarray(-np.linalg.solve(hessian, jacobian.T @ (weight * offset))), jacobian


def robust_cost(distance: Floats, band: float) -> Floats:
    """What each point of signed ``distance`` costs: 0 on the surface, 1 beyond the band inside (damage explains it),
    up to 2 outside (nothing does)."""
    return np.minimum((distance / band) ** 2, 1) + np.clip((distance - band) / (2 * band), 0, 1)
