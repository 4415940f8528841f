"""Colours of what a result shows, the same in the report, in its windows and in pictures."""

from __future__ import annotations

from collections.abc import Sequence

SITES = ("#d1495b", "#edae49", "#00798c", "#66a182", "#8d5b9f", "#d97a34", "#3f7fc1", "#a8577e")
PART, SURPLUS, UNSEEN, DEPOSIT = "#9aa5ad", "#9d6fc4", "#c77f00", "#2f86d6"
NOZZLE, BEAM, UNREACHED = "#c9a227", "#f05a28", "#e00000"
DEVIATION = "coolwarm"
"""matplotlib's colour map of signed deviations: blue below the nominal surface, red above it, as inspection has it;
grey between, so that it is seen on a light and on a dark ground."""

COOLWARM = ("#3b4cc0", "#6282ea", "#8db0fe", "#b9d0f9", "#dddcdc", "#f5c4ac", "#f4987a", "#dd5f4b", "#b40426")
"""That map at equal steps (K. Moreland, Diverging color maps for scientific visualization, 2009)."""
VIRIDIS = ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725")
"""The map of ordered values at equal steps (S. van der Walt, N. Smith, 2015)."""


def pick_colour(stops: Sequence[str], share: float) -> str:
    """The colour at a share (0 to 1) of the way through stops that lie at equal steps."""
    at = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    k = min(int(at), len(stops) - 2)
    ends = [[int(stops[k + j][i : i + 2], 16) for i in (1, 3, 5)] for j in (0, 1)]
    return "#" + "".join(f"{round(a + (b - a) * (at - k)):02x}" for a, b in zip(*ends, strict=True))


def colour_site(number: int) -> str:
    """The colour of a site by its number, which counts from 1."""
    return SITES[(number - 1) % len(SITES)]
