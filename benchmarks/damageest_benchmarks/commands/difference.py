"""`damageest evaluate difference`: what is found between two scans of one part."""

from __future__ import annotations

from typing import Annotated

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    pairs: Annotated[str, typer.Option(metavar="A,B", help="Words in the names of pairs. Default: all.")] = "",
    seeds: Annotated[str, typer.Option(help="Seeds of the scans.")] = "0",
    workers: Workers = 2,
    timeout: Timeout = 900,
    out: RowsFolder = None,
    write: Write = None,
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
