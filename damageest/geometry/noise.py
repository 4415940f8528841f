"""What a scan says about itself: how noisy its points are, and how far apart."""

from __future__ import annotations

import math

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.neighbourhoods import find_nearby

_SAMPLES = (4000, 1500)
_WHOLE = 200_000
_LEVELS = (16, 32, 64, 128, 256, 512)
_WIDE = 8.0
_SECTORS = 6


def measure_noise_and_spacing(points: Floats, seed: int = 0) -> tuple[float, float]:
    """Noise and spacing of a scan, ``points`` (N,3), in its unit of length; the same seed gives the same answer.

    Noise: the standard deviation of the points off the local surface. At a few thousand points a quadric is fitted to
    the nearest neighbours, all of them, however dense; the residual variance, by its degrees of freedom, of those
    patches that agree with one another is what the scanner's noise makes of a smooth surface. Patches across an edge, a
    damage or a second wall have more and fall out as long as they are few enough. Patches grow until they are wide
    against the noise: narrower ones would take the noise's own direction for the surface's. On a surface whose bends
    are all tighter than a patch the answer includes what a quadric cannot follow, hence is too high.

    Spacing: the gap that a reconstruction has to bridge. Round each sample point, in the local plane, the distance to
    the nearest neighbour in each of six sectors; the median of the six; and of these the median by area covered, not by
    number of points, so that neither dense rows of points nor dense regions hide the gaps between them. On a randomly
    sampled surface about 1.1 / sqrt(points per area), on a grid about the pitch.

    Fewer than 16 points: both are 0.
    """
    points = np.asarray(points, dtype=np.float64)
    if len(points) < _LEVELS[0]:
        return 0.0, 0.0
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(seed)
    dense = len(points) > _WHOLE
    centres = points[rng.permutation(len(points))[: _SAMPLES[dense]]]
    middle = centres.mean(axis=0)  # far from the origin, products of coordinates lose digits
    centres = centres - middle
    noise = spacing = 0.0
    settled, held = False, 0
    for k in sorted({min(k, len(points)) for k in _LEVELS}):
        if k > held:  # 64 mostly do
            held = max(k, 64) if dense else len(points)
            near = (_gather_around(points, centres + middle, held, rng) if dense else points) - middle
            tree = cKDTree(near, balanced_tree=False, compact_nodes=False)
        some = centres[: max(500, 400_000 // k)]  # wide patches average more points each: fewer of them will do
        far, index = (np.asarray(a) for a in tree.query(some, k=k))
        local, roundness = _to_local(near[index])
        if k <= 64:
            spacing = _measure_spacing(local[:, :, :2] - local[:, :1, :2]) or spacing
        even = roundness > 0.15
        # rows of points: the patch must span several before it shows the surface
        if not settled and even.sum() >= 0.3 * len(even):
            noise = _find_clean_level(_measure_residual_variance(local[even]), k - 6)
            settled = bool(np.median(far[:, -1]) >= _WIDE * noise)
        if settled and k >= 64:
            break
    return noise, spacing


def _gather_around(points: Floats, centres: Floats, count: int, rng: np.random.Generator) -> Floats:
    """The points round the centres (M,3), among them the ``count`` nearest of nearly each.

    Density must not be thinned, but a tree over all of very many points would cost seconds.
    """
    from scipy.spatial import cKDTree

    some = points[rng.integers(0, len(points), _WHOLE)]
    enough = max(3, math.ceil(1.3 * count * len(some) / len(points)))
    reach = np.asarray(cKDTree(some).query(centres, k=[enough + 1], workers=2)[0])
    return points[find_nearby(points, centres, float(np.percentile(reach, 95)))]


def _to_local(patches: Floats) -> tuple[Floats, Floats]:
    """Patches (m,k,3) in their principal axes, widest first, and how round each is, from 0 to 1."""
    centred = patches - patches.mean(1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", centred, centred))
    local = np.einsum("mki,mij->mkj", centred, axes[:, :, ::-1])
    spread = np.sqrt(np.maximum(spread, 0))
    return local, spread[:, 1] / np.maximum(spread[:, 2], 1e-300)


def _measure_residual_variance(local: Floats) -> Floats:
    """(m,) variance of each patch's heights over the quadric fitted to them, by k - 6 degrees of freedom."""
    size = np.maximum(np.abs(local[:, :, :2]).max(axis=(1, 2), keepdims=True), 1e-300)
    u, v = np.moveaxis(local[:, :, :2] / size, 2, 0)
    basis = np.linalg.qr(np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)).Q
    height = local[:, :, 2]
    rest = height - np.einsum("mki,mi->mk", basis, np.einsum("mki,mk->mi", basis, height))
    variance: Floats = np.einsum("mk,mk->m", rest, rest) / max(local.shape[1] - 6, 1)
    return variance


def _find_clean_level(variances: Floats, freedom: int) -> float:
    """The standard deviation that the lower, agreeing part of the patches' variances has in common.

    Under noise alone they follow sigma^2 chi^2(f) / f. Starts low in the distribution, then takes the median of all
    that sigma does not rule out, until that stands.
    """
    if freedom < 1:
        return 0.0
    from scipy.special import gammaincinv

    def quantile(share: float) -> float:
        return float(2 * gammaincinv(freedom / 2, share) / freedom)

    level = float(np.quantile(variances, 0.15)) / quantile(0.25)
    cut, middle = quantile(0.9), quantile(0.45)
    for _ in range(30):
        kept = variances[variances <= cut * level]
        if not len(kept):
            break
        level, before = float(np.median(kept)) / middle, level
        if abs(level - before) <= 1e-6 * before:
            break
    return float(np.sqrt(level))


def _measure_spacing(around: Floats) -> float:
    """The area-weighted median gap, from neighbours (m,k,2) in the plane, each patch's sample point at the origin."""
    distance = np.hypot(around[:, 1:, 0], around[:, 1:, 1])
    angle = np.arctan2(around[:, 1:, 1], around[:, 1:, 0])
    sector = np.floor((angle / (2 * np.pi) + 0.5) * _SECTORS).astype(np.int64) % _SECTORS
    nearest = np.sort(
        np.stack([np.where(sector == s, distance, np.inf).min(1) for s in range(_SECTORS)], axis=1), axis=1
    )
    gap = (nearest[:, 2] + nearest[:, 3]) / 2
    gap = np.sort(gap[np.isfinite(gap)])  # fewer than four sectors with a neighbour: the patch does not show the gap
    if len(gap) < 0.1 * len(around):
        return 0.0
    area = np.cumsum(np.minimum(gap, 3 * np.median(gap)) ** 2)
    return float(gap[np.searchsorted(area, area[-1] / 2)])
