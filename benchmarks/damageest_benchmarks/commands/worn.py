"""`damageest evaluate worn`: made parts that are worn as real ones are."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    every: Annotated[int, typer.Option(min=1, help="Take one draw of so many.")] = 1,
    workers: Workers = 1,
    timeout: Timeout = 600,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Count right results on 60 worn parts. Bushes, dies, rails, cams, seats and punches.

    Wear of 0.3 to 0.6 mm fades out over a bore, a face or a flank; all skin is off by a slow 0.04 to 0.07 mm; the
    points lie on the triangles of a scanner's mesh.
    """
    from damageest_evaluate.commands.counted import run_counted
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import prepare_places, write_measured
    from damageest_benchmarks.real.worn import make_worn_cases, make_worn_table

    def describe(row: dict[str, Any]) -> str:
        true = row["true"] or [0.0, 0.0]
        told = row["error"] or f"{row['volume']:.1f} ({row['low']:.0f} to {row['high']:.0f}), {row['verdict']}"
        return f"{row['kind']} {row['seed']}: {told}; worn {true[0]:.1f} to {true[1]:.1f}, {row['seconds']:.0f} s"

    prepare_places(out, write, "worn")
    cases = make_worn_cases(every, fingerprint_code(Registry.discover()))
    rows = run_counted(cases, out, "worn.jsonl", workers, timeout, describe)
    table = format_markdown(make_worn_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "worn", write)
