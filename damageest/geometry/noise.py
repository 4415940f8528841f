"""The noise and the point spacing of a scan, measured from its points alone."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.neighbourhoods import gather_around, make_tree
from damageest.geometry.sheets import query_own_sheet

AUTO_TOLERANCE = 4.0
"""Lambda over the scan's noise where the job says auto: 6 in 100,000 intact points deviate by more."""
AUTO_STEPS = 1.5
"""Least lambda over the step of the scan's depth where the job says auto; a point is off by up to half a step."""
_SAMPLES = (4000, 1500)
"""Places at which the scan is measured: for a scan of up to _WHOLE points, and for a larger one."""
_WHOLE = 200_000
_LEVELS = (16, 32, 64, 128, 256, 512)
"""Neighbours of a patch, tried in turn."""
_WIDE = 8.0
"""Ratio of a patch's radius to the noise from which the patch is wide enough."""
_SECTORS = 6
QUIET = 0.1
"""Share of the patches, the quietest, that `measure_quiet_noise` asks."""


def measure_noise_and_spacing(points: Floats, seed: int = 0) -> tuple[float, float]:
    """Noise and spacing of a scan with ``points`` (N,3), in the unit of the points, in any frame.

    Noise is the standard deviation of the points from the local surface. At a few thousand places a quadric is fitted
    to the nearest neighbours (a patch), all of them, also where points are dense. The residual variance of a patch,
    divided by its degrees of freedom, is that of the noise if the surface is smooth there. Patches across an edge, a
    damage or a second wall have a larger one; they are left out, provided they are the minority. Patches are widened
    until their radius is 8 times the noise, because the plane of a narrower patch follows the noise and not the
    surface. On a surface with radii of curvature smaller than a patch, the result includes what a quadric cannot
    follow and is too high.

    Spacing is the gap that a reconstruction has to bridge. Around each place, in the local plane, it takes the distance
    to the nearest neighbour in each of six sectors, and the median of the six. The median of these is weighted by area
    and not by number of points, so that dense rows or dense regions do not hide the gaps between them. It is about
    1.1 / sqrt(points per area) on a randomly sampled surface, and about the pitch on a grid.

    The same points and seed give the same result. Both are 0 for fewer than 16 points.
    """
    points = np.asarray(points, dtype=np.float64)
    if len(points) < _LEVELS[0]:
        return 0.0, 0.0
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(seed)
    dense = len(points) > _WHOLE
    centres = points[rng.choice(len(points), min(_SAMPLES[dense], len(points)), replace=False)]
    middle = centres.mean(axis=0)  # far from the origin, products of coordinates lose digits
    centres = centres - middle
    noise = spacing = 0.0
    settled, gathered, enough = False, 0, 0.0
    levels = sorted({min(k, len(points)) for k in _LEVELS})
    for k in levels:
        if k not in (levels[0], 64, levels[-1]) and (settled or k < enough):
            continue
        # wide patches average more points each, so fewer are needed
        some = centres[: max(500, (96_000 if dense else 400_000) // k)]
        if k > gathered:  # 64 are enough for most scans
            gathered = max(k, 64) if dense else len(points)
            around = points
            if dense:  # the points must not be thinned, because their density matters
                around = points[gather_around(points, (centres if k <= 64 else some) + middle, gathered, rng)]
            around = around - middle
            tree = cKDTree(around, balanced_tree=False, compact_nodes=False)
        far, index = query_own_sheet(tree, some, around, k)
        local, roundness = _to_principal_axes(around[index])
        if k <= 64:
            # more neighbours can only widen it; where it narrows, they lie on the far side of a bent wall
            spacing = max(spacing, _measure_spacing(local[:, :, :2] - local[:, :1, :2]))
        even = roundness > 0.15
        # where points lie in rows, a patch has to span several rows before it shows the surface
        if not settled and even.sum() >= 0.3 * len(even):
            noise = _find_clean_level(_measure_residual_variance(local[even]), k - 6)
            radius = float(np.median(far[:, -1]))
            settled = radius >= _WIDE * noise
            # four times the points make a patch twice as wide; well below that it is still too narrow
            enough = 0.6 * k * (_WIDE * noise / max(radius, 1e-300)) ** 2
        if settled and k >= 64:
            break
    return noise, spacing


def measure_quiet_noise(points: Floats, seed: int = 0) -> float:
    """The noise of a scan with ``points`` (N,3) where it is least: on the quietest tenth of the patches.

    Unlike `measure_noise_and_spacing` it is not too high where only some of the skin is curved or rough within a patch.
    It is too low where a patch is narrower than `_WIDE` times the noise. 0 for fewer than 16 points.
    """
    points = np.asarray(points, dtype=np.float64)
    count = _LEVELS[0]
    if len(points) < count:
        return 0.0
    from scipy.special import gammaincinv

    rng = np.random.default_rng(seed)
    centres = points[rng.choice(len(points), min(_SAMPLES[1], len(points)), replace=False)]
    around = gather_around(points, centres, count, rng) if len(points) > _WHOLE else slice(None)
    middle = centres.mean(axis=0)
    near = points[around] - middle
    _, index = query_own_sheet(make_tree(near), centres - middle, near, count)
    local, roundness = _to_principal_axes(near[index])
    even = roundness > 0.15  # points in a row say nothing of the surface
    if not even.any():
        return 0.0
    freedom = count - 6
    expected = float(2 * gammaincinv(freedom / 2, QUIET) / freedom)
    return float(np.sqrt(np.quantile(_measure_residual_variance(local[even]), QUIET) / expected))


def measure_scatter(patches: Floats) -> Floats:
    """Standard deviation (m,) of the points of patches (m,k,3), k > 6, from the quadric fitted to each."""
    return np.asarray(np.sqrt(_measure_residual_variance(_to_principal_axes(patches)[0])))


def _to_principal_axes(patches: Floats) -> tuple[Floats, Floats]:
    """Patches (m,k,3) in their principal axes, widest first, and the ratio (m,) of second to first width: near 0 for
    points in a row, 1 for a round patch."""
    centred = patches - patches.mean(1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", centred, centred))
    local = np.einsum("mki,mij->mkj", centred, axes[:, :, ::-1])
    spread = np.sqrt(np.maximum(spread, 0))
    return local, spread[:, 1] / np.maximum(spread[:, 2], 1e-300)


def _measure_residual_variance(local: Floats) -> Floats:
    """Variance (m,) of each patch's heights over the quadric fitted to them, with k - 6 degrees of freedom."""
    size = np.maximum(np.abs(local[:, :, :2]).max(axis=(1, 2), keepdims=True), 1e-300)
    u, v = np.moveaxis(local[:, :, :2] / size, 2, 0)
    basis = np.linalg.qr(np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)).Q
    height = local[:, :, 2]
    rest = height - np.einsum("mki,mi->mk", basis, np.einsum("mki,mk->mi", basis, height))
    variance: Floats = np.einsum("mk,mk->m", rest, rest) / max(local.shape[1] - 6, 1)
    return variance


def _find_clean_level(variances: Floats, freedom: int) -> float:
    """The standard deviation sigma of the noise, from the variances (m,) of the patches without edges or damage.

    With noise alone the variances follow sigma^2 chi^2(f) / f. Sigma is first taken from a low quantile, then again and
    again from the median of all variances that are plausible for sigma, until it no longer changes.
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
    gap = np.sort(gap[np.isfinite(gap)])  # with neighbours in fewer than four sectors, the gap is not measurable
    if len(gap) < 0.1 * len(around):
        return 0.0
    area = np.cumsum(np.minimum(gap, 3 * np.median(gap)) ** 2)
    return float(gap[np.searchsorted(area, area[-1] / 2)])


def find_least_depth(noise: Floats, correlated: float, depth_step: float, tolerance: float) -> Floats:
    """How deep a loss has to be (N,) to be seen where points deviate by ``noise`` (N,) each and by ``correlated`` with
    their neighbours: standard deviations in the unit of ``tolerance``."""
    return np.maximum(np.maximum(AUTO_TOLERANCE * np.hypot(noise, correlated), AUTO_STEPS * depth_step), tolerance)
