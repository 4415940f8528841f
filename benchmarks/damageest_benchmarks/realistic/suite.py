"""The cases: each sensor on each part, from one to twelve views, every second part with a loss."""

from __future__ import annotations

from collections.abc import Sequence

from damageest.errors import InputError
from damageest_benchmarks.realistic.case import RealisticCase
from damageest_benchmarks.realistic.sensors import SENSORS
from damageest_benchmarks.troubles.suite import choose_names

PARTS = (
    "block", "blade", "lever", "gear", "keyed_shaft", "tube", "ribbed_plate", "half_torus", "rib_bracket", "cylinder",
)  # fmt: skip
POINTS = 40_000
"""Points of a scan."""


def make_realistic_cases(
    sensors: Sequence[str] = (),
    parts: Sequence[str] = (),
    numbers: Sequence[int] = (),
    every: int = 1,
    points: int = POINTS,
    source: str = "",
) -> list[RealisticCase]:
    """The cases of the given sensors, parts and numbers (none given: all), one of ``every``.

    Names may be shortened to their beginning. Raises InputError for an unknown name, and if no case is left.
    """
    chosen = choose_names("--sensors", sensors, tuple(SENSORS))
    names = choose_names("--parts", parts, PARTS)
    cases = []
    for row, sensor in enumerate(SENSORS.values()):
        for column, part in enumerate(PARTS):
            # five numbers of views: each meets a loss and no loss
            views, damaged = sensor.views[(column + row) % len(sensor.views)], (column + row) % 2 == 1
            number = row * len(PARTS) + column + 1
            cases.append(RealisticCase(number, sensor.name, part, views, damaged, points, source=source))
    left = [
        case
        for case in cases
        if case.sensor in chosen and case.part in names and (not numbers or case.number in numbers)
    ][::every]
    if not left:
        raise InputError("no case has these sensors, parts and numbers; leave out --sensors, --parts or --case")
    return left
