"""`damageest evaluate prepare`: what it gains to open ragged damages before deposition."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFile, Write, prepare_places, write_measured


def command(
    count: Annotated[int, typer.Option(min=1, help="Number of damages.")] = 20,
    out: RowsFile = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Measure what opening a damage adds to a 3-axis path."""
    from damageest.registry import Registry
    from damageest_benchmarks.paths.prepare import make_prepare_table, run_prepare

    prepare_places(out.parent if out else None, write, "prepare")
    rows = []
    for row in run_prepare(count, Registry.discover(), out):
        rows.append(row)
        typer.echo(
            f"{row.name}: {row.before:.1%} {row.after:.1%} {row.milled:.2f} {row.convex:.2f} {row.why}", err=True
        )
    table = make_prepare_table(rows)
    show_table(table, list(map(asdict, rows)), as_json)
    write_measured(table, "prepare", write)
