"""How well errors of a size and wear explain the distances of patches together."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.stages.align.wear.skin_patches import Patches

LEAST_DEPTH = 0.3
"""Least mean depth of wear, in tolerances: shallower wear cannot be told from errors."""
STRAY, SPREAD = 0.01, 16.0
"""Share of patches that are neither unworn nor worn, such as added metal, and the width in tolerances over which they
lie."""
ROUNDS = 20
"""Rounds in which share and depth of the worn skin are fitted."""


def explain(patches: Patches, offset: Floats, error: float, noise: float, tolerance: float) -> float:
    """Mean log-likelihood of patches at signed distances ``offset`` (P,) by area, with ``tolerance`` as the unit of
    length: unworn skin lies on the part with a standard deviation of ``error``, worn skin below it, the more rarely the
    deeper. Share and mean depth of the worn skin are fitted (expectation and maximisation, Dempster and others 1977).

    ``offset``, ``error``, ``noise``, ``tolerance`` in diagonals.
    """
    weight = patches.weight / patches.weight.sum()
    at = offset / tolerance
    deviation = np.sqrt(noise**2 / np.maximum(patches.weight, 1.0) + error**2) / tolerance
    unworn = np.exp(-((at / deviation) ** 2) / 2) / (np.sqrt(2 * np.pi) * deviation)
    share, depth = 0.1, 1.0
    density = unworn
    for _ in range(ROUNDS):
        worn = share * np.where(at < 0, np.exp(np.minimum(at, 0) / depth) / depth, 0.0)
        density = (1 - STRAY) * ((1 - share) * unworn + worn) + STRAY / SPREAD
        belongs = weight * (1 - STRAY) * worn / density
        total = float(belongs.sum())
        share = min(max(total, 1e-6), 0.99)
        depth = max(-float(belongs @ np.minimum(at, 0)) / max(total, 1e-12), LEAST_DEPTH)
    return float(weight @ np.log(density))
