"""Numbers as the report shows them."""

from __future__ import annotations

import math

THIN = "\u202f"
"""Narrow space that does not break, between groups of digits and before a unit."""


def to_number(colour: str) -> int:
    return int(colour.lstrip("#"), 16)


def format_number(value: float | int | None, digits: int = 4) -> str:
    """A number with ``digits`` significant digits at least, without exponent where it is of common size; integers in
    full.

    The decimal mark is a point, and groups of three digits are set apart by a narrow space, as in ISO 80000.
    """
    if isinstance(value, int):
        digits = max(len(str(abs(value))), 1)
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if not -5 <= size < 12:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    text = f"{abs(value):.{max(digits - 1 - size, 0)}f}"
    whole, _, rest = text.partition(".")
    groups: list[str] = []
    while len(whole) > 4 or (groups and len(whole) > 3):
        groups.insert(0, whole[-3:])
        whole = whole[:-3]
    whole = THIN.join([whole, *groups])
    return ("−" if value < 0 else "") + whole + (f".{rest}" if rest else "")


def format_share(value: float) -> str:
    """A share in percent; never 100 % for less than all of it."""
    if value >= 1:
        return f"100{THIN}%"
    return f"{min(100 * value, 99.9):.{1 if value > 0.95 or value < 0.1 else 0}f}{THIN}%"
