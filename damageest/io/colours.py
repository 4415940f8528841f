"""Colours of what a result shows, the same in the report, in its windows and in pictures."""

from __future__ import annotations

SITES = ("#d1495b", "#edae49", "#00798c", "#66a182", "#8d5b9f", "#d97a34", "#3f7fc1", "#a8577e")
PART, SURPLUS, UNSEEN, DEPOSIT = "#9aa5ad", "#9d6fc4", "#c77f00", "#2f86d6"
DEVIATION = "coolwarm"
"""matplotlib's colour map of signed deviations: blue below the nominal surface, red above it, as inspection has it;
grey between, so that it is seen on a light and on a dark ground."""


def colour_site(number: int) -> str:
    """The colour of a site by its number, which counts from 1."""
    return SITES[(number - 1) % len(SITES)]
