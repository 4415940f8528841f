"""`damageest evaluate difference`: what is found between two scans of one part."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from damageest_evaluate.commands.counted import AsJson


def command(
    pairs: Annotated[str, typer.Option(metavar="A,B", help="Words in the names of pairs. Default: all.")] = "",
    seeds: Annotated[str, typer.Option(help="Seeds of the scans.")] = "0",
    workers: Annotated[int, typer.Option(min=1, help="Processes that run at the same time.")] = 2,
    timeout: Annotated[float, typer.Option(min=0, help="Seconds after which a process is stopped.")] = 900,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for difference.jsonl, to resume from.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option(help="File whose table between the marks `difference` is replaced.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare pairs of scans with a known loss between them.

    Poses are unknown, and most pairs overlap in part only.
    """
    from damageest_evaluate.commands.counted import format_command, run_counted
    from damageest_evaluate.job import fingerprint_code

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places, show_report, split_words
    from damageest_benchmarks.differences import describe_difference, make_difference_cases, make_difference_table

    prepare_places(out, write, "difference")
    numbers = parse_numbers("--seeds", seeds)
    cases = make_difference_cases(numbers, split_words(pairs), fingerprint_code(Registry.discover()))
    rows = run_counted(cases, out, "difference.jsonl", workers, timeout, describe_difference)
    text = make_difference_table(rows, format_command())
    show_report(lambda _: text, "difference", out, write, rows, as_json)
