"""Sections in the report: a table for each item of the job, and the drawings."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from damageest.artefacts import Section, SectionValue
from damageest.io.section_files import COLOURS, draw_section
from damageest.result import Result
from damageest.stages.report._words import N_, Words

PAGE = {**COLOURS, "ink": "var(--ink)", "soft": "var(--soft)", "metal": "var(--metal)"}

QUANTITIES = (
    N_("chord"), N_("leading edge"), N_("trailing edge"), N_("thickness"), N_("twist"), N_("bow"),
    N_("bow from straight"), N_("lean"), N_("form"), N_("deepest"), N_("highest"), N_("line profile"), N_("diameter"),
    N_("off centre"), N_("run-out"), N_("roundness"),
)  # fmt: skip


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


def group_sections(result: Result, words: Words) -> list[Group]:
    """The sections of a result by their item of the job and the quantities that they have."""
    digits = choose_decimals(result.tolerance)
    return [
        Group(
            tuple(name_quantity(name, words) for name in names),
            tuple((one, tuple(show_value(value, digits, words) for value in one.values)) for one in sections),
        )
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


def name_quantity(name: str, words: Words) -> str:
    """The name of a quantity, where that of a bore has its number."""
    found = re.fullmatch(r"bore (\d+) (.+)", name)
    return f"{words.tell('bore')} {found[1]} {words.tell(found[2])}" if found else words.tell(name)


def show_value(value: SectionValue, decimals: int, words: Words) -> Cell:
    """A value as a cell of a table."""

    def show(number: float, plus: bool = False) -> str:
        text = f"{abs(number):.{decimals}f}"
        return ("−" if number < 0 and float(text) else "+" if plus else "") + text

    if value.measured is None:
        nominal = words.tell("nominal {value}", value=show(value.nominal)) if value.nominal else ""
        return Cell("–", nominal, value.note)
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
