"""Measurements as Markdown tables, and their insertion into a text file such as a README."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from damageest_evaluate.tables import describe_measurement, format_markdown

from damageest.errors import InputError

if TYPE_CHECKING:
    from damageest_benchmarks.matrix import MatrixCell


def make_marks(kind: str) -> tuple[str, str]:
    """The lines that enclose a table in the text file. ``kind``: as matrix or suite."""
    return f"<!-- {kind}: begin -->", f"<!-- {kind}: end -->"


OFF = 0.03
"""Relative error of a volume from which the matrix shows it."""
LEAST_SHARE = 0.97
"""Intersection over union, as a share of that of the default stages, below which the table names an implementation."""
MATRIX = (
    "Columns with a job's name: intersection over union of found and true damage, with a star of found damage and that "
    "of the job's own stages; volume: found for true, where it is off by more than 3 %; flagged: a check of the result "
    "failed. stage, s: median seconds of the stage. run, s: median processor seconds of a run, without the stages up "
    "to the sites where these are those of the job. peak, MB: the largest peak memory of a run"
)


def make_matrix_table(cells: Sequence[MatrixCell], legend: bool = True) -> str:
    """A Markdown table: a row for each implementation, a column for each job. The reasons of refusals follow it.

    ``legend``: whether the text says what the columns are; not for a page that has the legend already.
    """
    jobs = list(dict.fromkeys(cell.job for cell in cells))
    rows = list(dict.fromkeys((cell.stage, cell.use) for cell in cells))
    cell_of = {(cell.stage, cell.use, cell.job): cell for cell in cells}
    reasons: list[str] = []
    head = ["stage", "implementation", *jobs, "stage, s", "run, s", "peak, MB"]
    lines = [head]
    before = ""
    for stage, use in rows:
        row = [cell_of[stage, use, job] for job in jobs]
        shown = [_format_cell(cell, reasons) for cell in row]
        figures = [
            _format_number([cell.stage_seconds for cell in row], "{:.2f}"),
            _format_number([cell.seconds for cell in row if not math.isnan(cell.iou)], "{:.1f}"),
            _format_number([cell.megabytes for cell in row], "{:.0f}", np.max),
        ]
        lines.append([stage if stage != before else "", use, *shown, *figures])
        before = stage
    notes = [f"{number}. {reason}" for number, reason in enumerate(reasons, 1)]
    if off := _list_off(cells):
        notes += ["", f"IoU below {LEAST_SHARE} of that of the defaults, or volume more than 3 % off theirs: {off}."]
    about = describe_measurement(MATRIX if legend else "")
    return "\n".join([format_markdown(lines, 2), "", about, *(["", *notes] if notes else [])])


def _list_off(cells: Sequence[MatrixCell]) -> str:
    """The cells with a result that is not that of the default stages."""
    usual = {cell.job: cell for cell in cells if not cell.stage}
    return ", ".join(
        f"{cell.stage}: {cell.use} on {cell.job}"
        for cell in cells
        if (own := usual.get(cell.job)) and not math.isnan(cell.iou)
        and (cell.iou < LEAST_SHARE * own.iou or abs(cell.volume - own.volume) > OFF * own.volume)
    )  # fmt: skip


def _format_cell(cell: MatrixCell, reasons: list[str]) -> str:
    if cell.refused and cell.refused not in reasons:
        reasons.append(cell.refused)
    why = f"refused [{reasons.index(cell.refused) + 1}]" if cell.refused else ""
    if math.isnan(cell.iou):
        return why or "–"
    off = f" (volume {cell.volume:.2f})" if abs(cell.volume - 1) > OFF else ""
    return f"{cell.iou:.3f}{off}" + (f", partly {why}" if why else " (flagged)" if cell.flagged else "")


def _format_number(values: Sequence[float], form: str, of: object = np.median) -> str:
    known = [value for value in values if not math.isnan(value)]
    return form.format(of(known)) if known and callable(of) else "–"


def replace_between_marks(path: Path, text: str | None, kind: str) -> str:
    """The file's text with ``text`` between the marks; None: unchanged. Raises InputError if the marks are missing."""
    first, last = make_marks(kind)
    try:
        old = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file: {error}") from None
    before, begin, rest = old.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end:
        raise InputError(
            f"{path}: the lines that enclose the table are missing\n  try: add the lines  {first}  and  {last}"
        )
    return old if text is None else f"{before}{first}\n\n{text}\n\n{last}{after}"
