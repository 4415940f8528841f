"""The symmetries of a part: rigid motions that map it onto itself. Found once, they give all poses that fit alike from
one of them, and the others need no fit of their own. And whether a plane mirrors it onto itself: then a scan and its
mirror image show the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import move_points
from damageest.stages.align.refine.robust_fit import fit
from damageest.stages.align.search.pairs import PairTable, propose_poses
from damageest.stages.align.search.search import search
from damageest.stages.align.surface.oriented_points import orient_surface
from damageest.stages.align.surface.plane_grid import PartSurface, PlaneGrid

EXACT = 1e-4
"""Distance, in diagonals, up to which a motion has to put all of the part's surface onto the part."""
TRIALS = 20_000
"""Candidate motions, of which the best are refined."""
START = 0.008
"""Width of the band, in diagonals, at which the fit of a motion begins."""
MOST_CORNERS = 20_000
"""Vertices of the part that are verified beside points of its surface: a small hole has few of those."""
SAME = 1e-3
"""Distance of two motions, in diagonals, below which they are the same symmetry."""
FAILURES = 5
"""Motions that are none, one after the other, after which the search ends: the best come first."""
MOST = 400
"""Symmetries beyond which a part is not described by them: it is nearly one of revolution."""

STEP = 5.0
"""Angle between the mirror planes that are tried, in degrees."""
MIRRORS, NEAR = 3, 0.012
"""Mirror planes that are fitted: the best, and only where the mean distance of their images is less, in diagonals."""


def find_symmetries(target: PartSurface, grid: PlaneGrid, pairs: PairTable, seed: int) -> Floats:
    """The symmetries (G,4,4) of a part that is centred and scaled to a diagonal of 1, the identity first.

    The part is searched in itself as a scan is in the part. Of what is found, one motion after the other is fitted and
    verified, and closed under composition, so that most need no fit of their own.
    """
    rng = np.random.default_rng([seed, 2])
    cloud = orient_surface(target.known, 3000, rng)
    surface = orient_surface(target.known, 4000, rng).points
    corners = target.mesh.vertices[rng.permutation(len(target.mesh.vertices))[:MOST_CORNERS]]
    group, failures = np.eye(4)[None], 0
    generators: list[Floats] = []
    for rough in search(propose_poses(cloud, pairs, TRIALS, rng), cloud, grid, rng):
        if measure_apart(group, rough).min() < 2 * START:
            continue
        motion = fit(target, surface[:1500], rough, START, 0.0, 15).pose
        if not _maps_onto_itself(target, motion, (surface, corners)):
            failures += 1
            if failures == FAILURES:
                break
            continue
        failures = 0
        if measure_apart(group, motion).min() < SAME:
            continue
        generators.append(motion)
        larger = _close(group, generators)
        if larger is None:
            break
        group = larger
    return group


def is_mirrored_onto_itself(target: PartSurface, grid: PlaneGrid, seed: int) -> bool:
    """Whether a plane mirrors a part of diagonal 1 onto itself: one that holds the direction of an axis of its frame.

    Middles of triangles are verified too: those in the wall of a hole lie inside the part where its rims lie on it.
    """
    if target.unseen is not None:
        return False
    rng = np.random.default_rng([seed, 3])
    surface = orient_surface(target.known, 4000, rng).points
    mirrors = make_reflections(surface.mean(axis=0))
    off = [float(np.abs(grid.estimate_distance(move_points(surface[:1000], one))).mean()) for one in mirrors]
    corners, middles = target.mesh.vertices, target.mesh.vertices[target.mesh.faces].mean(axis=1)
    checked = [surface, *(some[rng.permutation(len(some))[:MOST_CORNERS]] for some in (corners, middles))]
    for index in np.argsort(off, kind="stable")[:MIRRORS]:
        if off[index] > NEAR:
            break
        mirror = mirrors[index]
        moved = move_points(surface[:600], mirror)
        motion = fit(target, moved, np.eye(4), START, 0.0, 15).pose @ mirror
        if _maps_onto_itself(target, motion, checked):
            return True
    return False


def _maps_onto_itself(target: PartSurface, motion: Floats, checked: Sequence[Floats]) -> bool:
    return all(np.abs(target.closest(move_points(some, motion))[0]).max() < EXACT for some in checked)


def make_reflections(middle: Floats) -> Floats:
    """Reflections (K,4,4) at planes through ``middle`` (3,) that contain the direction of one of the axes."""
    angle = np.radians(np.arange(0, 180, STEP))
    normals = [np.roll(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), k, axis=1) for k in range(3)]
    normal = np.concatenate(normals)
    result = np.tile(np.eye(4), (len(normal), 1, 1))
    result[:, :3, :3] -= 2 * normal[:, :, None] * normal[:, None, :]
    result[:, :3, 3] = 2 * (normal @ middle)[:, None] * normal
    return result


def measure_apart(motions: Floats, one: Floats) -> Floats:
    """(K,) distance of motions (K,4,4) from ``one`` (4,4): rms over the corners of a cube as large as the part."""
    corner = np.array([[x, y, z, 1.0] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (-0.3, 0.3)])
    away = (motions - one)[..., :3, :] @ corner.T
    return np.asarray(np.sqrt((away**2).sum(axis=-2).mean(axis=-1)))


def pick_heads(poses: Floats, symmetries: Floats, apart: float, wanted: int) -> list[int]:
    """Indices of at most ``wanted`` poses of each set of poses (H,4,4) that differ by symmetries, the first ones."""
    heads: list[int] = []
    for index, pose in enumerate(poses):
        alike = sum(measure_apart(symmetries @ poses[head], pose).min() < apart for head in heads)
        if alike < wanted:
            heads.append(index)
    return heads


def _close(group: Floats, generators: list[Floats]) -> Floats | None:
    """The group (G,4,4) with the last of its generators and all products; None where they are more than `MOST`."""
    members = list(group)
    waiting = [one @ generators[-1] for one in members]
    while waiting:
        one = waiting.pop(0)
        if measure_apart(np.array(members), one).min() < SAME:
            continue
        members.append(one)
        if len(members) > MOST:
            return None
        waiting += [one @ generator for generator in generators]
    return np.array(members)
