"""Motions along which unworn skin does not fix the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.stages.align.wear.one_sided import OUTSIDE, measure_movement
from damageest.stages.align.wear.skin_patches import Patches

MIN_GAIN = 0.5
"""Contact that another pose has to gain, as a share of that which it loses, to explain the scan as well."""
CHANCE = 0.004
"""Share of the area that comes into contact or loses it by chance."""
WIDER = 1.5
"""By how much wider than the noise explains the band is in which skin counts as still in contact."""
MIN_MOVED, MIN_RANGE = 0.5, 0.3
"""Movement of the skin, in tolerances, from which two poses differ, and from which a motion is worth to be told."""
COMPARABLE = 0.5
"""Movement, as a share of the largest one, from which motions are compared by how few patches they move."""
STEPS = 60
"""Steps in which the range of a motion is searched."""


@dataclass(frozen=True)
class Freedom:
    """A motion that the scan does not exclude: ``motion`` (K,) in the basis of the patches, by which the skin moves by
    1 diagonal; ``low`` and ``high``: how far, in diagonals."""

    motion: Floats
    low: float
    high: float


def find_freedoms(
    patches: Patches, motions: Floats, band: Floats, tolerance: float, datum: Flags | None = None
) -> tuple[Freedom, ...]:
    """The motions from the present pose after which the scan fits about as well.

    ``motions`` (H,K): poses to be compared with. As well: with nothing more outside, and with other skin in contact, or
    less outside, in place of what no longer is in contact. Where skin was not scanned nothing comes into contact, and
    the pose is not free.
    ``datum`` (P,): patches that stay in contact.
    """
    moved = measure_movement(patches, motions)
    motions = motions[(moved > MIN_MOVED * tolerance) & _are_as_good(patches, motions, band, datum)]
    found: list[Freedom] = []
    spanned = np.zeros((motions.shape[1], 0))
    while len(motions) and len(found) < motions.shape[1]:
        rest = motions - motions @ spanned @ spanned.T
        size = measure_movement(patches, rest)
        far = size > MIN_MOVED * tolerance
        motions, rest, size = motions[far], rest[far], size[far]
        if not len(rest):
            break
        large = np.flatnonzero(size > COMPARABLE * size.max())
        # a shift along one axis rather than along two at once
        spread = np.abs(rest[large] @ patches.slopes.T) @ patches.weight / size[large]
        chosen = large[int(np.argmin(np.round(spread / patches.weight.sum(), 2)))]
        motion = rest[chosen] / size[chosen]
        spanned = np.linalg.qr(np.column_stack([spanned, motion]))[0]
        low, high = _find_range(patches, motion, band, 1.5 * float(size.max()), datum)
        if max(-low, high) > MIN_RANGE * tolerance:
            found.append(Freedom(motion, low, high))
    return tuple(found)


def _are_as_good(patches: Patches, motions: Floats, band: Floats, datum: Flags | None) -> Flags:
    """(H,) whether the scan fits about as well after motions (H,K) as in the present pose."""
    usable = patches.weight * patches.is_flat
    total = float(patches.weight.sum())
    start, offset = patches.offset / band, patches.move(motions) / band
    held = (np.abs(start) < 1) * usable
    left = np.abs(offset) > WIDER
    lost = left @ held / total
    gained = (np.abs(offset) < 1) @ (usable * (np.abs(start) >= 1)) / total
    outside = np.clip(offset - WIDER, 0, 1)
    pushed = outside @ (patches.weight * (start < 1)) / total
    # Smooth skin that lies outside now and does not then is a reason against the present pose: no wear explains it. On
    # added metal it does too, but there the move pushes the opposite skin outside.
    relieved = (np.clip(start - WIDER, 0, 1) - outside) @ (usable * (start >= 1)) / total
    good = gained + OUTSIDE * relieved + CHANCE > MIN_GAIN * lost + OUTSIDE * pushed
    if datum is not None:
        good &= left[:, datum] @ held[datum] <= 5 * CHANCE * held[datum].sum()
    return np.asarray(good)


def _find_range(
    patches: Patches, motion: Floats, band: Floats, most: float, datum: Flags | None
) -> tuple[float, float]:
    """How far the skin can be moved either way until patches lie outside that did not before, or leave the datum."""
    ends = []
    amounts = np.linspace(0, most, STEPS)
    for sign in (-1.0, 1.0):
        offset = patches.move(sign * amounts[:, None] * motion) / band
        outside = (offset > WIDER) @ (patches.weight * (patches.offset < band)) / patches.weight.sum()
        good = outside <= 2 * CHANCE
        if datum is not None:
            held = datum & (np.abs(patches.offset) < band)
            good &= (np.abs(offset[:, held]) > WIDER).mean(axis=1) <= 5 * CHANCE
        ends.append(sign * float(amounts[good].max(initial=0.0)))
    return ends[0], ends[1]
