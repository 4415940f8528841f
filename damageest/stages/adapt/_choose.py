"""Which field is fitted: as free as held-out patches of the scan say that it explains more than noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.duplicates import group_integers
from damageest.geometry.voxels import number_cubes
from damageest.stages.adapt._field import Body, Field, Freedom, match
from damageest.stages.adapt._fit import fit

PATCHES = 10.0
"""Patches along the part's diagonal."""
FEWEST = 5
"""Points in a patch, for it to be held out."""
LIMIT = 3.0
"""Deviation, in standard deviations of a point, beyond which a held-out point counts no more: damage, dirt."""
COUNTED = 0.5
"""Deviation, in tolerances, up to which one counts in any case: where the noise is far below the tolerance, all of the
skin would lie beyond the limit, and the few points within it would decide."""
GAIN = 1.5
"""Standard errors by which a freer field has to explain held-out patches better."""
SHARE = 0.1
"""Share of the score by which it has to be better at least: what a field explains less it makes uncertain again."""
BALANCE = 0.2
"""Share of what a field explains that has to lie outside the part as it was without it."""


class Score(NamedTuple):
    """Of each patch that was held out: ``both``, the mean square of its points' deviations, limited; ``outside``: that
    of deviations outward alone, which no wear can make."""

    both: Floats
    outside: Floats


@dataclass(frozen=True, eq=False)
class Trial:
    """A field of some freedom that was fitted to the scan, and how well it explains what it was not fitted to."""

    field: Field
    freedom: Freedom
    score: Score


def cut_patches(points: Floats, diagonal: float) -> tuple[Ints, Flags]:
    """The patch (N,) of each point, and which of two halves (N,) the patch is in; neighbours are drawn at random."""
    _, number = number_cubes(points, diagonal / PATCHES)
    first, patch, _ = group_integers(number)
    half = np.random.default_rng(31).permutation(len(first)) % 2 == 0
    return patch, half[patch]


def cross_validate(field: Field, points: Floats, body: Body, freedom: Freedom, scale: float, rounds: int,
                   patch: Ints, half: Flags) -> Score:  # fmt: skip
    """The score of a fit of this freedom, by two fits to half of the patches each. It starts from a field that is
    fitted to all, and forgets it: each round solves for the whole field."""
    count = int(patch.max()) + 1
    both, outside, size = np.zeros(count), np.zeros(count), np.bincount(patch, minlength=count)
    for held in (half, ~half):
        fitted = fit(field, points[~held], body, freedom, [scale] * rounds)
        found = match(fitted, points[held], body)
        limit = max(LIMIT * body.noise, COUNTED * 4 * body.step)
        off = np.where(found.faces_skin, found.distance, 0.0)
        squares = np.minimum(np.abs(off), limit) ** 2
        both += np.bincount(patch[held], squares, count)
        outside += np.bincount(patch[held], squares * (off > 0), count)
    kept = size >= FEWEST
    return Score(both[kept] / size[kept], outside[kept] / size[kept])


def is_better(after: Score, before: Score) -> bool:
    """Whether a freer field explains held-out patches better: over all, and where metal stands out. Wear is inward: a
    field that only follows it leaves as much outside as before. A deformed part stands out about as often as not."""
    gained, outside = float((before.both - after.both).mean()), float((before.outside - after.outside).mean())
    found = explains_more(after.both, before.both)[0] and explains_more(after.outside, before.outside)[0]
    return found and outside > BALANCE * gained


def explains_more(after: Floats, before: Floats) -> tuple[bool, float]:
    """Whether scores of patches (K,) are lower by more than chance, and by which share."""
    if len(after) < 8:
        return False, 0.0
    better = before - after
    gain = float(better.mean() / max(before.mean(), 1e-300))
    error = float(better.std() / np.sqrt(len(better)))
    return bool(better.mean() > GAIN * error and gain > SHARE), gain
