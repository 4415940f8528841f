"""Candidate poses, from pairs of oriented points that are congruent on scan and part.

Two oriented points have four invariants: their distance, the angle of each normal with the line between them, and the
angle between the normals about that line. A pair on the scan and a pair on the part with the same four invariants
determine a pose. The invariants of the part's pairs are hashed once (Drost et al. 2010); pairs are drawn at random
(Papazov and Burschka 2010).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import order_integers
from damageest.geometry.threads import cut_evenly, map_in_threads
from damageest.geometry.vectors import normalise
from damageest.stages.align.surface.oriented_points import OrientedPoints, draw_by_direction

MODEL_POINTS, MODEL_PAIRS = 1600, 800_000
SCAN_POINTS, SCAN_PAIRS, KEPT_PAIRS = 1200, 40_000, 6000
SHORTEST = 0.12
HASHED = 100_000
"""Pairs that are hashed at a time, so that intermediate arrays fit in the processor's cache."""
BINS = (26, 18, 18, 24)
"""Number of bins of the distance (0 to 1 diagonal), of the two angles with the line, of the angle about the line."""


@dataclass(frozen=True)
class PairTable:
    """Pairs of points on a part, in the order of their hashes.

    ``points``: the oriented points; ``i``, ``j`` (P,): the two of each pair; ``key`` (P,): its hash, ascending.
    """

    points: OrientedPoints
    i: Ints
    j: Ints
    key: Ints

    @classmethod
    def build(cls, part: OrientedPoints, rng: np.random.Generator) -> PairTable:
        """Draws pairs from the points of a part."""
        points = draw_by_direction(part, MODEL_POINTS, rng)
        i, j = rng.integers(0, len(points.points), (2, MODEL_PAIRS))
        key, good = _hash_pairs(points, i, j)
        i, j, key = i[good], j[good], key[good]
        order = order_integers(key)
        return cls(points, i[order], j[order], key[order])


def propose_poses(scan: OrientedPoints, part: PairTable, wanted: int, rng: np.random.Generator) -> Floats:
    """About ``wanted`` poses (H,4,4) from scan to part; a few of them are near the true pose.

    Where the sign of the scan's normals is unknown, each pair is tried with both signs at both points.
    """
    part_points, i, j, key = part.points, part.i, part.j, part.key
    scan_points = draw_by_direction(scan, SCAN_POINTS, rng)
    p, q = rng.integers(0, len(scan_points.points), (2, SCAN_PAIRS))
    signs = [(1, 1)] if scan.signed else [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    ones = np.ones(SCAN_PAIRS)
    tried = [(p, q, ones * a, ones * b, *_hash_pairs(scan_points, p, q, a, b)) for a, b in signs]
    p, q, a, b, target_key, good = (np.concatenate(column) for column in zip(*tried, strict=True))
    first, last = np.searchsorted(key, target_key, "left"), np.searchsorted(key, target_key, "right")
    count = np.where(good, last - first, 0)
    # A pair with a thousand matches is less useful than one with few: each pair gets the same number of trials.
    chance = np.where(count > 0, 1 / np.maximum(count, 12), 0)
    if not chance.any():
        return np.eye(4)[None]
    total = np.cumsum(chance)
    at = (np.arange(KEPT_PAIRS) + rng.random(KEPT_PAIRS)) / KEPT_PAIRS * total[-1]
    chosen = np.unique(np.minimum(np.searchsorted(total, at), len(total) - 1))
    share = np.minimum(count[chosen], max(4, wanted // len(chosen)))
    chosen = np.repeat(chosen, share)
    match = first[chosen] + (rng.random(len(chosen)) * count[chosen]).astype(np.int64)

    ones, ends = np.ones(len(match)), (p[chosen], q[chosen], a[chosen], b[chosen])
    cosine = np.einsum("ij,ij->i", scan_points.normals[ends[0]], scan_points.normals[ends[1]]) * ends[2] * ends[3]
    scan_frame, scan_origin = _build_frames(scan_points, *ends, cosine)
    part_frame, part_origin = _build_frames(part_points, i[match], j[match], ones, ones, cosine)
    poses = np.tile(np.eye(4), (len(chosen), 1, 1))
    poses[:, :3, :3] = part_frame @ np.swapaxes(scan_frame, 1, 2)
    poses[:, :3, 3] = part_origin - np.einsum("hij,hj->hi", poses[:, :3, :3], scan_origin)
    return poses


def _hash_pairs(cloud: OrientedPoints, i: Ints, j: Ints, a: int = 1, b: int = 1) -> tuple[Ints, NDArray[np.bool_]]:
    """The hash (M,) of each pair's four invariants, and whether these are well defined (M,).

    ``i``, ``j`` (M,): the points of each pair; ``a``, ``b``: signs of their normals.
    """
    found = map_in_threads(lambda own: _hash_some(cloud, i[own], j[own], a, b), cut_evenly(len(i), HASHED))
    key, good = (np.concatenate(column) for column in zip(*found, strict=True))
    return key, good


def _hash_some(cloud: OrientedPoints, i: Ints, j: Ints, a: int, b: int) -> tuple[Ints, NDArray[np.bool_]]:
    """As `_hash_pairs`, all at once."""
    points, normals = cloud.points.astype(np.float32), cloud.normals.astype(np.float32)
    line = points[j] - points[i]
    length = np.linalg.norm(line, axis=1)
    line /= np.maximum(length, np.float32(1e-12))[:, None]
    n, m = (np.float32(a) * normals)[i], (np.float32(b) * normals)[j]
    along, beside = np.einsum("ij,ij->i", n, line), np.einsum("ij,ij->i", m, line)
    # Normals along the line do not fix the angle about it.
    good = (length > SHORTEST) & (np.abs(along) < 0.94) & (np.abs(beside) < 0.94)
    n, m, line, length, along, beside = (each[good] for each in (n, m, line, length, along, beside))
    (n0, n1, n2), (m0, m1, m2), (x, y, z) = n.T, m.T, line.T
    # of the normals without their parts along the line: the product that turns, and the one that does not
    across = x * (n1 * m2 - n2 * m1) + y * (n2 * m0 - n0 * m2) + z * (n0 * m1 - n1 * m0)
    turn = np.arctan2(across, np.einsum("ij,ij->i", n, m) - along * beside)
    invariants = (
        length,
        np.arccos(along) / np.pi,
        np.arccos(beside) / np.pi,
        (turn / (2 * np.pi) + 0.5 / BINS[3]) % 1.0,
    )
    key = np.zeros(len(length), np.int64)
    for figure, bins in zip(invariants, BINS, strict=True):
        # Half a bin's offset keeps the commonest invariants, multiples of a right angle, in the middle of a bin.
        key = key * (bins + 1) + np.clip(figure * bins + (0.5 if figure is not invariants[3] else 0.0), 0, bins).astype(
            np.int64
        )
    every = np.zeros(len(i), np.int64)
    every[good] = key
    return every, good


def _build_frames(
    cloud: OrientedPoints, i: Ints, j: Ints, a: Floats, b: Floats, cosine: Floats
) -> tuple[Floats, Floats]:
    """A right-handed frame (M,3,3), columns the axes, and an origin (M,3) that move with the pair.

    Computed from the two normals where ``cosine`` (M,) shows that they differ enough, since normals are more exact than
    the line between the points; else from their mean and the line.
    """
    n, m = cloud.normals[i] * a[:, None], cloud.normals[j] * b[:, None]
    line = cloud.points[j] - cloud.points[i]
    alike = np.abs(cosine) > 0.85
    parallel = n + np.where(cosine < 0, -1.0, 1.0)[:, None] * m
    x = normalise(np.where(alike[:, None], parallel, n + m), 1e-12)
    y = np.where(alike[:, None], line, n - m)
    y = normalise(y - np.einsum("ij,ij->i", x, y)[:, None] * x, 1e-12)
    return np.stack([x, y, np.cross(x, y)], axis=2), (cloud.points[i] + cloud.points[j]) / 2
