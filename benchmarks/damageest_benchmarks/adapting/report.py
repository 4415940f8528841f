"""The tables of the suite of deformed parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import format_markdown

from damageest_benchmarks.adapting.case import TOLERANCE
from damageest_benchmarks.adapting.suite import GROUPS, USES

NAMES = {"straight": "none, the part as designed", "none": "rigid", "plain": "plain non-rigid fit"}
SURE = ("likely", "proven")


def format_adapting_row(row: Row) -> str:
    """One line of progress."""
    what = row["varied"]
    if row["error"]:
        return f"{what['group']}: {what['case']}, {what['adapt']}: {row['error']}"
    low, high = row["interval"]
    verdicts = ", ".join(row["verdicts"]) or "no site"
    return (
        f"{what['group']}: {what['case']}, {what['adapt']}: IoU {row['iou']:.3f}, {row['found']:.4g} of "
        f"{row['true']:.4g} mm³, {low:.4g} to {high:.4g}{'' if row['inside'] else ' (outside)'}, {verdicts}, moved by "
        f"{row['amount'] / TOLERANCE:.1f} tolerances, {row['seconds']:.0f} s"
    )


def make_adapting_table(rows: Sequence[Row]) -> str:
    """A table in Markdown with a line for each group and each way to adapt."""
    head = ["cases", "adapt", "ended", "IoU, median", "IoU ≥ 0.95", "volume, median", "truth inside", "right verdict",
            "false sites", "s, median"]  # fmt: skip
    lines = []
    for group in GROUPS:
        for use in USES:
            chosen = [row for row in rows if row["varied"]["group"] == group and row["varied"]["adapt"] == use]
            if chosen:
                lines.append(_make_line(group, use, chosen))
    return format_markdown([head, *lines], names=2)


def _make_line(group: str, use: str, rows: Sequence[Row]) -> list[str]:
    ended = [row for row in rows if not row["error"]]
    lossy = [row for row in ended if row["true"] > 0]
    overlaps = [row["iou"] for row in lossy]
    shares = [row["found"] / row["true"] for row in lossy]
    false = sum(any(level in SURE for level in row["verdicts"]) for row in ended if not row["true"])
    return [
        group,
        NAMES.get(use, use),
        f"{len(ended)} of {len(rows)}",
        _tell(overlaps, "{:.3f}"),
        _count([value >= 0.95 for value in overlaps]),
        _tell(shares, "{:.0%}"),
        _count([row["inside"] for row in ended]),
        _count([_is_right(row) for row in ended]),
        f"{false}" if len(lossy) < len(ended) else "",
        _tell([row["seconds"] for row in ended], "{:.0f}"),
    ]


def _is_right(row: Row) -> bool:
    """Whether the loss is said to be there: a site that is likely or proven; and none where nothing is lost."""
    said = any(level in SURE for level in row["verdicts"])
    return said if row["true"] > 0 else not said


def _tell(values: Sequence[float], form: str) -> str:
    return form.format(float(np.median(values))) if values else ""


def _count(values: Sequence[Any]) -> str:
    return f"{sum(map(bool, values))} of {len(values)}" if values else ""
