"""`damageest evaluate suite --intervals`: how often the truth lies in the 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from damageest_evaluate.commands.counted import format_command, show_table
from damageest_evaluate.processes import Row


def show_intervals(rows: Sequence[Row], write: Path | None, marks: str, as_json: bool) -> None:
    """Prints the table, and puts it between the marks of ``write``."""
    from damageest_benchmarks.intervals import make_interval_tables
    from damageest_benchmarks.readme import replace_between_marks

    text = make_interval_tables(rows, format_command())
    show_table(text, rows, as_json)
    if write:
        write.write_text(replace_between_marks(write, text, marks), encoding="utf-8")
