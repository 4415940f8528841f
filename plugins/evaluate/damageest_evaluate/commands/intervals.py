"""`damageest evaluate suite --intervals`: how often the truth lies in the 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from damageest_evaluate.commands._counted import prepare_places, show_table


def run_intervals(
    cases: int, seed: int, parts: Sequence[str], jobs: int, timeout: float, out: Path | None,
    write: Path | None, marks: str, command: str, scheduler: str, as_json: bool = False,
) -> None:  # fmt: skip
    """Runs the cases, prints the table, and puts it between the marks of ``write``."""
    from damageest.registry import Registry
    from damageest_evaluate.intervals import format_interval_row, make_interval_cases, make_interval_tables
    from damageest_evaluate.readme import replace_between_marks
    from damageest_evaluate.rows import run_all

    prepare_places(out, write, marks)
    planned = make_interval_cases(cases, seed, parts, Registry.discover())
    count = 0

    def print_row(row: dict[str, Any]) -> None:
        nonlocal count
        count += 1
        typer.echo(f"[{count}/{len(planned)}] {format_interval_row(row)}", err=True)

    rows = run_all(planned, out / "intervals.jsonl" if out else None, jobs, timeout, print_row, scheduler)
    text = make_interval_tables(rows, command)
    show_table(text, rows, as_json)
    if write:
        write.write_text(replace_between_marks(write, text, marks), encoding="utf-8")
