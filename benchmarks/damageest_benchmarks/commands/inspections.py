"""`damageest evaluate inspections`: repaired parts with known faults."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    draws: Annotated[int, typer.Option(min=1, help="Workpieces, each with twelve inspections.")] = 10,
    workers: Workers = 1,
    timeout: Timeout = 1800,
    out: RowsFolder = None,
    write: Write = None,
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
