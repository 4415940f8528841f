"""The pose by the outermost surface: unworn skin lies on the part, worn skin inside it, and nothing outside it.

Sets of a few patches that are taken as unworn give poses (Fischler and Bolles 1981); the best are fitted with an
asymmetric kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats
from damageest.geometry.threads import cut_evenly
from damageest.stages.align.wear.skin_patches import Patches

REACH = 3.0
"""Standard deviations of a patch's mean up to which it is in contact with the skin."""
OUTSIDE = 3.0
"""Cost of an area outside the skin against the gain of one in contact with it. Added metal costs no more than this."""
SIZES = (1, 2, 3, 6)
"""Numbers of patches that a pose is made from; the motions that they do not fix stay as they are."""
TRIALS = 500
"""Poses for each of the sizes."""
REFINED = 160
"""Poses that are fitted."""
ROUNDS = 12
MOVED = 0.9
"""Quantile of the movements of the patches that measures a motion."""
DAMPING = 1e-3
CACHED = 120_000
"""Bytes of the offsets of as many motions as are taken at a time."""


@dataclass(frozen=True)
class Scored:
    """Motions (H,K) in the basis of the patches, best first, with their ``score`` (H,) as shares of the area, and the
    score of the present pose, ``start``."""

    motions: Floats
    score: Floats
    start: float


def measure_bands(patches: Patches, noise: float, least: float) -> Floats:
    """(P,) distance from the skin up to which the mean of a patch may be that of unworn skin. ``least``: standard
    deviation of a mean that form errors give."""
    points = np.maximum(patches.weight, 1.0)
    return np.asarray(REACH * np.sqrt(noise**2 / points + least**2))


@dataclass(frozen=True)
class Proposals:
    """Motions (H,K) in the basis of the patches, the present pose first, the ``offset`` (H,P) of the patches after
    each, in single precision, and whether each moves the skin far (H,)."""

    motions: Floats
    offset: NDArray[np.float32]
    is_far: Flags


def propose_motions(patches: Patches, apart: float, rng: np.random.Generator) -> Proposals:
    """Motions that bring a few patches to the skin. ``apart``: movement of the skin from which on one is far."""
    found = [np.zeros((1, patches.basis.shape[1]))]
    found += [_propose(patches, size, TRIALS, rng) for size in SIZES]
    motions = np.concatenate(found)
    moved = motions.astype(np.float32) @ patches.slopes.T.astype(np.float32)
    far = [np.count_nonzero(np.abs(moved[own]) > apart, axis=1) for own in _cut(len(moved), moved[:1].nbytes)]
    is_far = np.concatenate(far) > (1 - MOVED) * moved.shape[1]
    return Proposals(motions, moved + patches.offset.astype(np.float32), is_far)


def score_offsets(patches: Patches, offset: NDArray[Any], band: Floats) -> Floats:
    """(H,) share of the area in contact with the skin, less that outside it as `OUTSIDE` says, for the patches' offsets
    (H,P) after motions."""
    kind = offset.dtype.type
    band, weight = band.astype(kind), (patches.weight / patches.weight.sum()).astype(kind)
    flat = weight * patches.is_flat
    score = np.empty(len(offset))
    for own in _cut(len(offset), offset[:1].nbytes):
        share = offset[own] / band
        outside = np.clip(share - 1, 0, 1) @ weight
        score[own] = np.maximum(1 - share**2, 0) @ flat - OUTSIDE * outside
    return score


def search_motions(patches: Patches, proposals: Proposals, band: Floats) -> Scored:
    """The motions from the present pose by which skin comes into contact and little lies outside.

    Half of them move the skin far, so that other poses which explain the scan are among them.
    """
    score = score_offsets(patches, proposals.offset, band)
    first = np.argsort(-score, kind="stable")[: REFINED // 2]
    far = np.flatnonzero(proposals.is_far)
    others = far[np.argsort(-score[far], kind="stable")[: REFINED // 2]]
    motions = refine_motions(patches, proposals.motions[np.unique([0, *first, *others])], band)
    score = score_offsets(patches, patches.move(motions), band)
    order = np.argsort(-score, kind="stable")
    return Scored(motions[order], score[order], float(score_offsets(patches, patches.offset[None], band)[0]))


def measure_movement(patches: Patches, motions: Floats) -> Floats:
    """(H,) movement of the skin along its normal by motions (H,K), in diagonals."""
    return np.asarray(np.quantile(np.abs(motions @ patches.slopes.T), MOVED, axis=1))


def _propose(patches: Patches, size: int, trials: int, rng: np.random.Generator) -> Floats:
    """Motions (H,K), each the smallest that brings ``size`` patches to the skin. Patches that tell more about the pose
    than others of their size are drawn more often."""
    slopes = patches.slopes
    usable = np.flatnonzero(patches.is_flat)
    if not len(usable):
        return np.empty((0, slopes.shape[1]))
    leverage = patches.weight[usable] * (1 + (slopes[usable] ** 2).sum(axis=1))
    drawn = usable[rng.choice(len(usable), (trials, size), p=leverage / leverage.sum())]
    some = slopes[drawn]
    normal = some @ np.swapaxes(some, 1, 2) + DAMPING * np.eye(size)
    steps = np.linalg.solve(normal, -patches.offset[drawn][..., None])
    return np.asarray((np.swapaxes(some, 1, 2) @ steps)[..., 0])


def refine_motions(patches: Patches, motions: Floats, band: Floats, rounds: int = ROUNDS) -> Floats:
    """The motions (H,K) fitted to the patches near the skin, and away from those a little outside."""
    some = _cut(len(motions), patches.offset.nbytes)
    return np.concatenate([_refine(patches, motions[own], band, rounds) for own in some])


def _cut(count: int, size: int) -> list[slice]:
    """``count`` rows of ``size`` bytes in groups that stay in the processor's cache: a quarter of the time of all at
    once."""
    return cut_evenly(count, max(1, CACHED // max(size, 1)))


def _refine(patches: Patches, motions: Floats, band: Floats, rounds: int) -> Floats:
    """As `refine_motions`, all at once."""
    slopes = patches.slopes
    count = slopes.shape[1]
    products = (slopes[:, :, None] * slopes[:, None, :]).reshape(len(slopes), -1)
    usable = patches.weight * patches.is_flat / band**2
    for number in range(rounds):
        wide = max(1.0, 2.0 - 2.0 * number / rounds)
        offset = patches.move(motions)
        share = offset / (wide * band)
        weight = np.maximum(1 - share**2, 0) ** 2 * usable
        weight += ((share > 1) & (share < 2)) * OUTSIDE / np.maximum(share, 1) * usable / 2
        normal = (weight @ products).reshape(-1, count, count)
        trace = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        normal = normal + (DAMPING * trace / max(count, 1) + 1e-300) * np.eye(count)
        steps = np.linalg.solve(normal, -((weight * offset) @ slopes)[..., None])[..., 0]
        motions = motions + steps
    return np.asarray(motions)
