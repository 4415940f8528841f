"""What the report says of sections: a table for each item of the job, and the drawings."""

from __future__ import annotations

import math
from dataclasses import dataclass

from damageest.artefacts import Section, SectionValue
from damageest.io.section_files import COLOURS, draw_section
from damageest.result import Result

PAGE = {**COLOURS, "ink": "var(--ink)", "soft": "var(--soft)", "metal": "var(--metal)"}


@dataclass(frozen=True)
class Cell:
    """A value as text: ``measured``, its ``difference`` from nominal with its error, and a ``note``."""

    measured: str
    difference: str
    note: str


@dataclass(frozen=True)
class Group:
    """Sections with the same quantities: their ``names``, and for each section its values in this order."""

    names: tuple[str, ...]
    rows: tuple[tuple[Section, tuple[Cell, ...]], ...]


def group_sections(result: Result) -> list[Group]:
    """The sections of a result by their item of the job and the quantities that they have."""
    digits = choose_decimals(result.tolerance)
    return [
        Group(names, tuple((one, tuple(show_value(value, digits) for value in one.values)) for one in sections))
        for (_, names), sections in collect_groups(result).items()
    ]


def collect_groups(result: Result) -> dict[tuple[int, tuple[str, ...]], list[Section]]:
    """The sections of a result by the number of their item of the job and the names of their quantities."""
    found: dict[tuple[int, tuple[str, ...]], list[Section]] = {}
    for section in result.sections:
        found.setdefault((section.group, tuple(value.name for value in section.values)), []).append(section)
    return found


def choose_decimals(tolerance: float) -> int:
    """Decimals with which lengths are shown: two digits more than the tolerance has."""
    return max(2 - math.floor(math.log10(tolerance)), 0)


def show_value(value: SectionValue, decimals: int) -> Cell:
    """A value as a cell of a table."""

    def show(number: float, plus: bool = False) -> str:
        text = f"{abs(number):.{decimals}f}"
        return ("−" if number < 0 and float(text) else "+" if plus else "") + text

    if value.measured is None:
        return Cell("–", f"nominal {show(value.nominal)}" if value.nominal else "", value.note)
    sign = "°" if value.unit == "degrees" else ""
    error = f"± {show(2 * value.error)}" if value.error else ""
    if not value.nominal:
        return Cell(f"{show(value.measured)}{sign}", error, value.note)
    difference = show(value.measured - value.nominal, plus=True)
    return Cell(f"{show(value.measured)}{sign}", f"{difference} {error}".strip(), value.note)


def draw_sections(result: Result) -> dict[int, str]:
    """The drawings by number, as SVG in the page's colours."""
    return {
        one.number: draw_section(one, result.tolerance, result.units, PAGE) for one in result.sections if one.contours
    }
