"""`damageest evaluate sections`: diameters of shafts that are out of round."""

from __future__ import annotations

from typing import Annotated

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, Write


def command(
    draws: Annotated[int, typer.Option(min=1, help="Shafts, six kinds in turn.")] = 60,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Count shaft diameters within their uncertainty.

    The shafts have lobes, wear on one side and grooves, seen all around or on an arc of 206 to 298 degrees.
    """
    from damageest_evaluate.tables import format_markdown

    from damageest_benchmarks.commands._counted import write_measured
    from damageest_benchmarks.sections.family import make_sections_table, measure_shaft

    rows = [measure_shaft(seed) for seed in range(draws)]
    table = format_markdown(make_sections_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "sections", write)
