"""The matrix as a table for a README, and its place there."""

from __future__ import annotations

import datetime
import math
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from damageest.errors import InputError

if TYPE_CHECKING:
    from damageest.evaluate.matrix import Cell

BEGIN, END = "<!-- matrix: begin -->", "<!-- matrix: end -->"


def table(cells: Sequence[Cell]) -> str:
    """A Markdown table of cells: a row for each implementation, a column for each job, below why some refused."""
    jobs = list(dict.fromkeys(cell.job for cell in cells))
    rows = list(dict.fromkeys((cell.stage, cell.use) for cell in cells))
    found = {(cell.stage, cell.use, cell.job): cell for cell in cells}
    reasons: list[str] = []
    head = ["stage", "implementation", *jobs, "stage, s", "run, s", "peak, MB"]
    lines = [_line(head), _line(["---", "---", *(["---:"] * (len(head) - 2))])]
    before = ""
    for stage, use in rows:
        mine = [found[stage, use, job] for job in jobs]
        shown = [_shown(cell, reasons) for cell in mine]
        figures = [
            _number([cell.stage_seconds for cell in mine], "{:.2f}"),
            _number([cell.seconds for cell in mine if not math.isnan(cell.iou)], "{:.1f}"),
            _number([cell.megabytes for cell in mine], "{:.0f}", np.max),
        ]
        lines.append(_line([stage if stage != before else "", use, *shown, *figures]))
        before = stage
    notes = [f"{number}. {reason}" for number, reason in enumerate(reasons, 1)]
    return "\n".join([*lines, "", _about(), *(["", *notes] if notes else [])])


def _line(words: Sequence[str]) -> str:
    return "| " + " | ".join(words) + " |"


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


def _about() -> str:
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "pyvista", "manifold3d", "libigl"))
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    return (
        "Intersection over union with the truth; medians of the stage's and of the whole run's seconds, the largest "
        f"peak memory of a process. Measured {day}: damageest {version('damageest')}, "
        f"Python {platform.python_version()}, {libraries}; {platform.machine()}, {os.cpu_count()} cores."
    )


def placed(path: Path, text: str | None) -> str:
    """The file's text with the lines between the marks replaced. Raises InputError where it has no such marks."""
    old = path.read_text()
    before, begin, rest = old.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"{path}: the table goes between the lines  {BEGIN}  and  {END}, which are not there")
    return old if text is None else f"{before}{BEGIN}\n\n{text}\n\n{END}{after}"
