"""`damageest evaluate real`: real worn parts with their CAD."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    folder: Annotated[Path, typer.Argument(exists=True, file_okay=False, help="Folder with a folder for each part.")],
    draws: Annotated[
        str, typer.Option(metavar="A,B", help="own, or seeds of points drawn. Default: own,7,8,9,10.")
    ] = "",
    tolerances: Annotated[str, typer.Option(metavar="A,B", help="Default: 0.15,0.2,0.3,auto.")] = "",
    workers: Workers = 1,
    timeout: Timeout = 900,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Run real parts and compare them with a crude difference.

    The difference shares no code with the program. In the found pose it sums the loss deeper than the tolerance, and
    the same with its shallow rim; both sums must lie in the site's interval.
    """
    from damageest_evaluate.commands.counted import run_counted
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import prepare_places, split_words, write_measured
    from damageest_benchmarks.real.case import DRAWS, PARTS, TOLERANCES, RealCase, list_sources, make_real_table

    prepare_places(out, write, "real")
    source = fingerprint_code(Registry.discover())
    present = [part for part in PARTS if (folder / part.name / part.scan).is_file()]
    cases = [
        RealCase(f"{folder}", part, draw, tolerance, source=source)
        for part in present
        for tolerance in split_words(tolerances) or TOLERANCES
        for draw in split_words(draws) or DRAWS
    ]

    def describe(row: dict[str, Any]) -> str:
        told = row["error"] or f"{row['volume']:.1f} ({row['low']:.0f} to {row['high']:.0f}), {row['verdict']}"
        return f"{row['part']}, {row['draw']}, {row['tolerance']}: {told}, {row['seconds']:.0f} s"

    rows = run_counted(cases, out, "real.jsonl", workers, timeout, describe)
    text = f"{format_markdown(make_real_table(rows))}\n\n{format_markdown(list_sources())}"
    show_table(text, rows, as_json)
    write_measured(text, "real", write)
