"""Units of length: their names, the factors between them, and telling a wrong one from the sizes of scan and part."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from damageest.artefacts import Floats
from damageest.errors import InputError, suggest

MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
"""The units by the name that a job file uses, and how many millimetres each is."""

FULL = {"um": "micrometres", "mm": "millimetres", "cm": "centimetres", "m": "metres", "in": "inches", "ft": "feet"}

_ALIASES = {
    "um": "µm μm micron microns micrometre micrometres micrometer micrometers",
    "mm": "millimetre millimetres millimeter millimeters",
    "cm": "centimetre centimetres centimeter centimeters",
    "m": "metre metres meter meters",
    "in": 'inch inches "',
    "ft": "foot feet '",
}
_NAMES = {alias: unit for unit, text in _ALIASES.items() for alias in (unit, *text.split())}


def canonical_unit(name: str) -> str:
    """The short name of a unit: 'inches' gives 'in'. Raises InputError with the near miss and the valid names."""
    key = name.strip().lower()
    if key in _NAMES:
        return _NAMES[key]
    raise InputError(f"unknown unit '{name}'{suggest(key, list(_NAMES))}; valid units: {', '.join(MILLIMETRES)}")


def unit_factor(source: str, target: str) -> float:
    """What a length in ``source`` is multiplied by to be in ``target``: factor('in', 'mm') is 25.4."""
    source, target = canonical_unit(source), canonical_unit(target)
    return 1.0 if source == target else MILLIMETRES[source] / MILLIMETRES[target]


def _check_unit(name: str) -> str:
    try:
        return canonical_unit(name)
    except InputError as error:  # pydantic collects ValueErrors, so that a job's faults are all named at once
        raise ValueError(str(error)) from None


Unit = Annotated[str, AfterValidator(_check_unit), Field(examples=list(MILLIMETRES))]
"""A unit as an option of a stage: checked with the job, and brought to its short name."""


def _spread_directions(count: int = 200) -> Floats:
    """(count,3) unit vectors, evenly over the half sphere (a Fibonacci spiral)."""
    i = np.arange(count) + 0.5
    z, turn = i / count, np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z * z)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def _measure_size(points: Floats, clip: float) -> float:
    """The largest width of the points over all directions, leaving out the share ``clip`` at either end of each."""
    points = points[:: max(1, len(points) // 5000)]
    along = (points - points.mean(0)) @ _spread_directions().T
    low, high = np.quantile(along, [clip, 1 - clip], axis=0) if clip else (along.min(axis=0), along.max(axis=0))
    return float((high - low).max())


def diagnose_scale(
    scan_points: Floats,
    part_vertices: Floats,
    unit: str = "mm",
    smallest: float = 0.3,
    largest: float = 3.0,
) -> str | None:
    """A sentence on what is wrong where the scan's size cannot be the part's, or None where it can.

    Both ``scan_points`` (N,3) and ``part_vertices`` (V,3) are as read and converted to ``unit``, in any pose: what is
    compared is the largest width over all directions, for the scan without the outermost 1 % of its points. A scan from
    ``smallest`` times (metal lost, surface unseen) to ``largest`` times (a fixture around it) the part's size passes.
    Otherwise a factor between two units is looked for that leaves a plausible ratio; the likelier mistakes first.
    """
    scan, part = _measure_size(scan_points, 0.01), _measure_size(part_vertices, 0.0)
    if not scan > 0 or not part > 0:
        return None
    ratio = scan / part
    if smallest <= ratio <= largest:
        return None
    here = canonical_unit(unit)
    apart = f"{_format_ratio(ratio)} the part's ({scan:.4g} against {part:.4g} {here})"

    best: tuple[float, float, str] | None = None
    for culprit, sign in (("scan", 1), ("part", -1)):
        for other in MILLIMETRES:
            if other == here:
                continue
            # numbers that mean ``other`` but were read as ``here`` are off by factor(here, other)
            off = unit_factor(here, other) ** sign
            left = ratio / off
            if 0.4 <= left <= 1.3:
                rare = 0.3 if {other, here} & {"um", "ft"} else 0.0
                cost = abs(float(np.log(left))) + rare
                if best is None or cost < best[0] - 1e-9:
                    best = (cost, off, f"set {culprit}.unit: {other} if the {culprit}'s numbers are in {FULL[other]}")
                elif best is not None and cost <= best[0] + 1e-9:
                    best = (best[0], best[1], f"{best[2]}, or {culprit}.unit: {other} if the {culprit}'s are")
    if best is None:
        return (
            f"the scan's size is {apart}, which no confusion of units explains; "
            "check that scan and part belong together, and crop away what is not the part"
        )
    return (
        f"the scan's size is {apart}: it looks as if one of the two were read in the wrong unit, "
        f"{_format_ratio(best[1])} off; {best[2]}"
    )


def _format_ratio(ratio: float) -> str:
    """A ratio in words: '25.4 times' or '1/25.4 of'."""
    return f"{ratio:.4g} times" if ratio >= 1 else f"1/{1 / ratio:.4g} of"
