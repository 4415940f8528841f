"""`damageest evaluate others` and `reported`: parts that others made, and what they report in public."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    folder: Annotated[Path, typer.Argument(exists=True, file_okay=False, help="Folder with files of CAD or meshes.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the losses, scans and poses.")] = 0,
    workers: Workers = 1,
    timeout: Timeout = 600,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Find a drawn loss on each part of a folder.

    Stages that take five times their median are named. 120,000 points of unknown pose; noise 0.0004 and tolerance
    0.0015 of the diagonal.
    """
    from damageest_evaluate.commands.counted import run_counted
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import prepare_places, write_measured
    from damageest_benchmarks.others import SUFFIXES, describe_file_row, make_file_cases, make_others_table

    prepare_places(out, write, "others")
    cases = make_file_cases(folder, seed, fingerprint_code(Registry.discover()))
    if not cases:
        raise InputError(f"{folder} has no part; put files there that end in {', '.join(SUFFIXES)}")
    rows = run_counted(cases, out, "others.jsonl", workers, timeout, describe_file_row)
    table = format_markdown(make_others_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "others", write)


def reported(
    words: Annotated[
        list[str] | None, typer.Argument(help="Words of a report's kind or address. Default: all reports.")
    ] = None,
    workers: Workers = 1,
    timeout: Timeout = 600,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Run what users of other tools report in public.

    Made anew with known truth: scans that were filtered, filled, smoothed or doubled, sensors that are wrong, models
    that are coarse or inside out.
    """
    from damageest_evaluate.commands.counted import run_counted, show_table
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import prepare_places, write_measured
    from damageest_benchmarks.reported.case import (
        describe_reported_row,
        make_reported_cases,
        make_reported_table,
        summarise,
    )

    prepare_places(out, write, "reported")
    cases = make_reported_cases(words or (), fingerprint_code(Registry.discover()))
    if not cases:
        raise InputError(f"no report has one of the words {', '.join(words or ())}; leave them out for all reports")
    rows = run_counted(cases, out, "reported.jsonl", workers, timeout, describe_reported_row)
    table = f"{format_markdown(make_reported_table(rows))}\n\n{summarise(rows)}"
    show_table(table, rows, as_json)
    write_measured(table, "reported", write)
