"""What points have beside coordinates, by the names that programs give it, and units in comments."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.errors import InputError
from damageest.geometry.units import canonical_unit

CONFIDENCE = ("confidence", "scalar_confidence", "quality", "scalar_quality")
"""Names of the confidence of a point in any case, the first that a file has."""
COLOURS = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
)
"""Names of the colours of a point."""

_UNIT = re.compile(
    r"\bunits?\b(?:\s+of\s+(?:length|measure(?:ment)?))?\s*[:=]?\s*(?:(?:is|are)\b\s*)?(?:in\s+(?=\S))?"
    r"""["']?([a-zµμ]+)""",
    re.IGNORECASE,
)


def find_confidence(names: Iterable[str]) -> str | None:
    """The name, among those of a file, of the confidence of a point; None where it has none."""
    known = {name.lower(): name for name in names}
    return next((known[name] for name in CONFIDENCE if name in known), None)


def find_colours(names: Iterable[str]) -> tuple[str, str, str] | None:
    """The names, among those of a file, of the red, green and blue of a point; None where it has none."""
    known = {name.lower(): name for name in names}
    for red, green, blue in COLOURS:
        if {red, green, blue} <= set(known):
            return known[red], known[green], known[blue]
    return None


def scale_colours(values: NDArray[Any], largest: float | None = None) -> NDArray[np.uint8]:
    """Colours (N,3) as numbers from 0 to 255.

    ``largest``: the value of full brightness. None: 255 for whole numbers up to it, 65535 for larger ones; for others
    1, or 255 where one is above 1.
    """
    if values.dtype == np.uint8:
        return values
    if largest is None:
        high = float(np.nanmax(values, initial=0.0))
        largest = (255.0 if high <= 255 else 65535.0) if values.dtype.kind in "iu" else (1.0 if high <= 1 else 255.0)
    scaled = np.asarray(values, np.float64) * (255.0 / (largest or 1.0))
    return np.clip(np.nan_to_num(np.round(scaled)), 0, 255).astype(np.uint8)


def find_unit(lines: Sequence[str]) -> tuple[str | None, str]:
    """The unit that comments of a header name, for example 'units: mm', and the comment; None where none does, or where
    they name several."""
    found: dict[str, str] = {}
    for line in lines:
        for word in _UNIT.findall(line):
            try:
                found.setdefault(canonical_unit(word), " ".join(line.split())[:80])
            except InputError:
                continue
    return next(iter(found.items())) if len(found) == 1 else (None, "")
