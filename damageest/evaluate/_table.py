"""Measurements as tables for a README, and their place there."""

from __future__ import annotations

import datetime
import math
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damageest.errors import InputError

if TYPE_CHECKING:
    from damageest.evaluate.matrix import Cell


def marks(kind: str) -> tuple[str, str]:
    """The lines between which a table goes: of kind matrix or suite."""
    return f"<!-- {kind}: begin -->", f"<!-- {kind}: end -->"


MATRIX = (
    "Intersection over union with the truth; medians of the stage's and of the whole run's seconds, the largest peak "
    "memory of a process"
)


def table(cells: Sequence[Cell]) -> str:
    """A Markdown table of cells: a row for each implementation, a column for each job, below why some refused."""
    jobs = list(dict.fromkeys(cell.job for cell in cells))
    rows = list(dict.fromkeys((cell.stage, cell.use) for cell in cells))
    found = {(cell.stage, cell.use, cell.job): cell for cell in cells}
    reasons: list[str] = []
    head = ["stage", "implementation", *jobs, "stage, s", "run, s", "peak, MB"]
    lines = [head]
    before = ""
    for stage, use in rows:
        mine = [found[stage, use, job] for job in jobs]
        shown = [_shown(cell, reasons) for cell in mine]
        figures = [
            _number([cell.stage_seconds for cell in mine], "{:.2f}"),
            _number([cell.seconds for cell in mine if not math.isnan(cell.iou)], "{:.1f}"),
            _number([cell.megabytes for cell in mine], "{:.0f}", np.max),
        ]
        lines.append([stage if stage != before else "", use, *shown, *figures])
        before = stage
    notes = [f"{number}. {reason}" for number, reason in enumerate(reasons, 1)]
    return "\n".join([markdown(lines, 2), "", about(MATRIX), *(["", *notes] if notes else [])])


def markdown(lines: Sequence[Sequence[str]], names: int = 1) -> str:
    """A Markdown table, its head first; all columns but the first ``names`` to the right."""
    rule = ["---"] * names + ["---:"] * (len(lines[0]) - names)
    return "\n".join("| " + " | ".join(words) + " |" for words in (lines[0], rule, *lines[1:]))


def _shown(cell: Cell, reasons: list[str]) -> str:
    if cell.refused and cell.refused not in reasons:
        reasons.append(cell.refused)
    why = f"refused [{reasons.index(cell.refused) + 1}]" if cell.refused else ""
    if math.isnan(cell.iou):
        return why or "–"
    return f"{cell.iou:.3f}" + (f", partly {why}" if why else " (doubted)" if cell.doubtful else "")


def _number(values: Sequence[float], form: str, of: object = np.median) -> str:
    known = [value for value in values if not math.isnan(value)]
    return form.format(of(known)) if known and callable(of) else "–"


def about(what: str) -> str:
    """``what`` was measured, when, with which versions and on what machine."""
    found = versions()
    libraries = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    return f"{what}. Measured {found['date']}: {libraries}; {found['machine']}."


def versions() -> dict[str, Any]:
    """Today's date, the versions of what computes, and the machine."""
    names = ("damageest", "numpy", "pyvista", "manifold3d", "libigl")
    return {
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "versions": {"Python": platform.python_version(), **{name: version(name) for name in names}},
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
    }


def placed(path: Path, text: str | None, kind: str) -> str:
    """The file's text with the lines between the marks replaced. Raises InputError where it has no such marks."""
    first, last = marks(kind)
    try:
        old = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file: {error}") from None
    before, begin, rest = old.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end:
        raise InputError(f"{path}: the table goes between the lines  {first}  and  {last}, which are not there")
    return old if text is None else f"{before}{first}\n\n{text}\n\n{last}{after}"
