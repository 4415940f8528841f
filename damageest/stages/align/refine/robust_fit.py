"""Robust fit of scan points to the triangles of the part."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align.surface.plane_grid import PartSurface

REACH = 3.5
"""Half-width of the kernel, in standard deviations of the points' distances to the surface."""

MAX_DRIFT = 0.25
"""How far the points may move, in bands, before their closest points are searched again; until then their planes are
used."""


@dataclass(frozen=True)
class Fit:
    """A fitted ``pose`` (4,4). ``band``: distance from the surface beyond which points had no weight. ``residue``: rms
    change of the points' distances to the surface in the last step."""

    pose: Floats
    band: float
    residue: float


def fit(target: PartSurface, points: Floats, pose: Floats, band: float, noise: float, rounds: int) -> Fit:
    """Point-to-plane Gauss-Newton steps on the closest points of the triangles, weighted by Tukey's biweight.

    The kernel starts ``band`` wide and narrows to `REACH` standard deviations of the points within it, of at least
    ``noise`` each. At the end damage and dirt have no weight. ``points`` (N,3), ``pose`` (4,4), at most ``rounds``
    steps; all lengths in diagonals of the part.
    """
    return fit_each(target, [points], [pose], band, noise, rounds)[0]


def fit_each(
    target: PartSurface, points: Sequence[Floats], poses: Sequence[Floats], band: float, noise: float, rounds: int
) -> list[Fit]:
    """As `fit`, for points (N,3) and a pose (4,4) of each fit. The fits go on side by side: the closest points of all
    of them are one question, since libigl uses all cores only where many points are asked for."""
    fits = [_fit(target, some, pose, band, noise, rounds) for some, pose in zip(points, poses, strict=True)]
    asked, results = {number: next(one) for number, one in enumerate(fits)}, {}
    while asked:
        distance, foot, face = target.closest(np.concatenate(list(asked.values())))
        stop, waiting = 0, {}
        for number, at in asked.items():
            own = slice(stop, stop := stop + len(at))
            try:
                waiting[number] = fits[number].send((distance[own], foot[own], face[own]))
            except StopIteration as end:
                results[number] = end.value
        asked = waiting
    return [results[number] for number in range(len(fits))]


def _fit(
    target: PartSurface, points: Floats, pose: Floats, band: float, noise: float, rounds: int
) -> Generator[Floats, tuple[Floats, Floats, Ints], Fit]:
    """The steps of one fit: gives the places (N,3) whose distances, closest points and faces it needs next."""
    narrowest = max(REACH * noise, 2e-5)
    step = residue = drift = np.inf
    for step_number in range(rounds):
        at = move_points(points, pose)
        if drift > MAX_DRIFT * band:
            distance, foot, face = yield at
            if step_number == 0:  # the pose moves by a few bands at most: points farther off are not needed
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
        pose = make_motions(twist[None])[0] @ pose
        step = float(np.hypot(np.linalg.norm(twist[:3]) / 2, np.linalg.norm(twist[3:])))
        drift += step
        residue = float(np.sqrt(np.average((jacobian @ twist) ** 2, weights=weight + 1e-12)))
        narrower = min(band, max(REACH * deviation, 0.6 * band, narrowest))
        if step < 0.003 * narrowest and narrower > 0.97 * band:
            break
        band = narrower
    return Fit(pose, max(band, narrowest), residue)


def solve_gauss_newton(at: Floats, normals: Floats, weight: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """One Gauss-Newton step of points ``at`` (N,3) toward planes.

    ``normals`` (N,3): of the planes; ``offset`` (N,): signed distances of the points to them; ``weight`` (N,).

    Returns:
        The twist (6,), a rotation vector and a translation, and the Jacobian (N,6) of the offsets.
    """
    jacobian = np.column_stack([np.cross(at, normals), normals])
    hessian = jacobian.T @ (jacobian * weight[:, None])
    # A little damping for motions that the surface does not fix, such as the rotation of a shaft.
    hessian += np.diag(np.full(6, 1e-6 * max(float(np.trace(hessian)), 1e-12)))
    return np.asarray(-np.linalg.solve(hessian, jacobian.T @ (weight * offset))), jacobian


def robust_cost(distance: Floats, band: float) -> Floats:
    """The cost (N,) of points at signed ``distance`` (N,): 0 on the surface, 1 deeper inside than the band (it may be
    damage), up to 2 outside (no damage explains it)."""
    return np.minimum((distance / band) ** 2, 1) + np.clip((distance - band) / (2 * band), 0, 1)
