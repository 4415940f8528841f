"""`damageest evaluate inspections`: repaired parts with known faults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import AsJson, show_table


def command(
    draws: Annotated[int, typer.Option(min=1, help="Workpieces, each with twelve inspections.")] = 10,
    workers: Annotated[int, typer.Option(min=1, help="Workpieces that run at the same time.")] = 1,
    timeout: Annotated[float, typer.Option(min=0, help="Seconds after which a workpiece is stopped.")] = 1800,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for inspections.jsonl, to resume from.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option(dir_okay=False, help="File with the marks of this table, to write it there.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Count right verdicts on repaired parts. Faulty parts signed as met are listed.

    Brackets, blocks and shafts with three repaired sites: perfect ones, and ones with a known fault.
    """
    from damageest_evaluate.commands.counted import run_counted
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import write_measured
    from damageest_benchmarks.repaired.case import make_repaired_cases, make_repaired_table

    def describe(row: dict[str, Any]) -> str:
        wrong = [one["kind"] for one in row["inspections"] if one["signed_wrongly"]]
        unmet = [one["kind"] for one in row["inspections"] if one["perfect"] and one["whole"] != "met"]
        told = row["error"] or f"signed wrongly: {', '.join(wrong) or 'none'}; perfect, not met: {len(unmet)}"
        return f"workpiece {row['seed']}: {told}; {row['seconds']:.0f} s"

    cases = make_repaired_cases(draws, fingerprint_code(Registry.discover()))
    rows = run_counted(cases, out, "inspections.jsonl", workers, timeout, describe)
    table = format_markdown(make_repaired_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "inspections", write)
