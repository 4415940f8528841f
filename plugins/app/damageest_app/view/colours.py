"""Colours of deviations, in tolerances, and their legend."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.io.colours import COOLWARM, pick_colour

REACH = 5.0
"""Tolerances at which the colours end."""


@cache
def _table() -> NDArray[np.uint8]:
    return spread(COOLWARM, 256)


def spread(stops: Sequence[str], count: int) -> NDArray[np.uint8]:
    """(count,3) colours at equal steps through a map."""
    chosen = [pick_colour(stops, share) for share in np.linspace(0, 1, count)]
    return np.asarray([[int(one[k : k + 2], 16) for k in (1, 3, 5)] for one in chosen], np.uint8)


def colour_deviation(distance: Floats, tolerance: float) -> NDArray[np.uint8]:
    """(N,3) colours of signed distances to the nominal surface; grey where there is none (NaN)."""
    share = np.clip(np.nan_to_num(distance / tolerance) / (2 * REACH) + 0.5, 0, 1)
    colours: NDArray[np.uint8] = _table()[(share * 255).astype(int)]
    colours[np.isnan(distance)] = 150
    return colours


def make_legend(tolerance: float, unit: str) -> list[dict[str, str]]:
    """The legend from the top: colour, and its distance in tolerances and in the job's unit."""
    rows = []
    for step in (5, 3, 2, 1, 0, -1, -2, -3, -5):
        red, green, blue = colour_deviation(np.array([step * tolerance]), tolerance)[0]
        edge = {5: "≥ ", -5: "≤ "}.get(step, "")
        value = f"{step * tolerance:+.3g} {unit}" if step else f"0 {unit}"
        rows.append(
            {"colour": f"rgb({red},{green},{blue})", "label": f"{edge}{step:+d} λ" if step else "0", "value": value}
        )
    return rows
