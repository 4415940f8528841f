"""Units of length: their names, the factors between them, and the check of scan and part for a wrong unit."""

from __future__ import annotations

import itertools
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from damageest.artefacts import Floats
from damageest.errors import InputError, suggest

MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
"""Millimetres in each unit, by the short name that a job file uses."""

FARTHEST = 1e12
"""Largest coordinate, in any unit: beyond it double precision leaves less than six digits for a metre of micrometres,
and its powers would leave the range of numbers."""

FULL_NAMES = {
    "um": "micrometres",
    "mm": "millimetres",
    "cm": "centimetres",
    "m": "metres",
    "in": "inches",
    "ft": "feet",
}
"""The name of each unit in messages."""

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
    """The short name of a unit: 'inches' gives 'in'. Upper and lower case are equal.

    Raises InputError for an unknown name, with the most similar known name and the valid ones.
    """
    key = name.strip().lower()
    if key in _NAMES:
        return _NAMES[key]
    raise InputError(f"unknown unit '{name}'{suggest(key, list(_NAMES))}; valid units: {', '.join(MILLIMETRES)}")


def unit_factor(source: str, target: str) -> float:
    """The factor from a length in ``source`` to the same length in ``target``: unit_factor('in', 'mm') is 25.4.

    Raises InputError for an unknown unit.
    """
    source, target = canonical_unit(source), canonical_unit(target)
    return 1.0 if source == target else MILLIMETRES[source] / MILLIMETRES[target]


def _check_unit(name: str) -> str:
    try:
        return canonical_unit(name)
    except InputError as error:  # pydantic collects ValueErrors, so that all faults of a job are reported at once
        raise ValueError(str(error)) from None


UnitOption = Annotated[str, AfterValidator(_check_unit), Field(examples=list(MILLIMETRES))]
"""A unit as an option of a stage: checked with the job, and replaced by its short name."""


def _spread_directions(count: int = 200) -> Floats:
    """Unit vectors (count,3), evenly over a half sphere (a Fibonacci spiral)."""
    i = np.arange(count) + 0.5
    z, turn = i / count, np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z * z)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def _measure_size(points: Floats, clip: float) -> float:
    """The largest width of the points over all directions, without the share ``clip`` of points at either end."""
    if not len(points):
        return 0.0
    points = points[:: max(1, len(points) // 5000)]
    along = (points - points.mean(0)) @ _spread_directions().T
    low, high = np.quantile(along, [clip, 1 - clip], axis=0) if clip else (along.min(axis=0), along.max(axis=0))
    return float((high - low).max())


CLEAR = 0.7
"""Ratio of the sizes of scan and part, after the unit is set right, above which the unit alone explains them."""


def diagnose_scale(
    scan_points: Floats,
    part_vertices: Floats,
    unit: str = "mm",
    smallest: float = 0.3,
    largest: float = 3.0,
) -> str | None:
    """A message where the size of the scan cannot be that of the part, None where it can.

    The largest widths over all directions are compared, for the scan without the outermost 1 % of its points. If their
    ratio is not plausible, the message names the unit whose use would explain it, the likeliest mistake first.

    Args:
        scan_points: (N,3) as read, converted to ``unit``, in any frame.
        part_vertices: (V,3) as read, converted to ``unit``, in any frame.
        unit: the unit of both.
        smallest: least plausible ratio of the scan's size to the part's (metal is lost, surface is hidden).
        largest: greatest plausible ratio (a fixture around the part is in the scan).

    Raises InputError for an unknown unit.
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
            # numbers in ``other`` that were read as ``here`` are wrong by unit_factor(here, other)
            off = unit_factor(here, other) ** sign
            left = ratio / off
            if 0.4 <= left <= 1.3:
                rare = 0.3 if {other, here} & {"um", "ft"} else 0.0
                cost = abs(float(np.log(left))) + rare
                if best is None or cost < best[0] - 1e-9:
                    best = (
                        cost,
                        off,
                        f"set {culprit}.unit: {other} if the {culprit}'s numbers are in {FULL_NAMES[other]}",
                    )
                elif best is not None and cost <= best[0] + 1e-9:
                    best = (best[0], best[1], f"{best[2]}, or {culprit}.unit: {other} if the {culprit}'s are")
    if best is None:
        best = _find_two_units(ratio, here)
    if best is None:
        crop = "crop the scan to the part"
        piece = "where only a piece of the part was scanned, give the pose: align: none or align: icp"
        return (
            f"the scan's size is {apart}, and no wrong unit explains it; "
            f"check that the scan is of this part; {piece if ratio < 1 else crop}"
        )
    more = "; or the scan shows more than the part: crop it" if ratio > largest and ratio / best[1] < CLEAR else ""
    return (
        f"the scan's size is {apart}: one of the two was {'perhaps' if more else 'probably'} read in the wrong unit, "
        f"which makes it {_format_ratio(best[1])} the other's; {best[2]}{more}; or part and scan are swapped"
    )


def _find_two_units(ratio: float, here: str) -> tuple[float, float, str] | None:
    """The metric units of scan and part that explain a ratio of sizes where both were read in the wrong unit: the cost,
    the ratio that they explain, and what to set. In a job in millimetres, centimetres against metres give 100."""
    found = []
    for scan, part in itertools.permutations(("mm", "cm", "m"), 2):
        off = unit_factor(here, scan) / unit_factor(here, part)
        if here not in (scan, part) and 0.4 <= ratio / off <= 1.3:
            advice = (
                f"set scan.unit: {scan} and part.unit: {part} if the scan's numbers are in {FULL_NAMES[scan]} and the "
                f"part's in {FULL_NAMES[part]}"
            )
            found.append((abs(float(np.log(ratio / off))), off, advice))
    return min(found, default=None)


SMALLEST, LARGEST = 1.0, 200_000.0
"""Millimetres across, beyond which the size of a part is doubtful."""
TINY = 40.0
"""Tolerances across a part below which its unit is doubtful: usual are some hundreds, and an inch is 25 millimetres."""


def diagnose_size(part_vertices: Floats, unit: str) -> str | None:
    """A message where a part is so small or so large that the job's unit is doubtful, None where it is not.

    A scan and a part in metres, in a job in millimetres, agree with each other; their size alone shows it. A job in
    micrometres may have a part of any size.
    """
    here = canonical_unit(unit)
    if not len(part_vertices):
        return None
    across = float(np.ptp(part_vertices, axis=0).max()) * MILLIMETRES[here]
    if here == "um" or SMALLEST <= across <= LARGEST:
        return None
    shown = f"{across:.2g} mm" if across < SMALLEST else f"{across / 1000:.4g} m"
    return (
        f"the part is {shown} across; is `units: {here}` right? Set it to the unit of the numbers in part and scan, or "
        "give  unit: ...  for each of them"
    )


def describe_size(points: Floats, unit: str, clip: float = 0.0) -> str:
    """The size of points (N,3) along the axes of their frame, as text: '40 x 30 x 20 mm'; without the share ``clip`` of
    them at either end, such as strays."""
    if not len(points):
        return f"0 {unit}"
    low, high = np.quantile(points, [clip, 1 - clip], axis=0)
    return " x ".join(f"{length:.3g}" for length in high - low) + f" {unit}"


def question_size(tolerance: float, part_vertices: Floats, unit: str) -> str | None:
    """A message where a part is so small against the tolerance that the job's unit is doubtful, None where it is not:
    part and scan of one wrong unit agree with each other."""
    across = float(np.linalg.norm(np.ptp(part_vertices, axis=0))) if len(part_vertices) else 0.0
    if not 0 < across < TINY * tolerance:
        return None
    return (
        f"the part is {describe_size(part_vertices, unit)}, only {across / tolerance:.2g} tolerances of {tolerance:.3g}"
        f" {unit} across; is `units: {unit}` right for the numbers of part and scan, and is the tolerance in it?"
    )


def _format_ratio(ratio: float) -> str:
    """A ratio in words: '25.4 times' or '1/25.4 of'."""
    return f"{ratio:.4g} times" if ratio >= 1 else f"1/{1 / ratio:.4g} of"
