"""`damageest evaluate honesty`: how often a result is right, wrong but said, or wrong and silent."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    kinds: Annotated[
        str, typer.Option(metavar="A,B", help="Kinds of trouble, in full or their beginning. Default: all.")
    ] = "",
    parts: Annotated[str, typer.Option(metavar="A,B", help="Names of parts. Default: all.")] = "",
    seeds: Annotated[str, typer.Option(metavar="A,B", help="Seeds; each case runs once with each of them.")] = "0",
    case: Annotated[str, typer.Option(metavar="A,B", help="Numbers of cases, from the list of silent ones.")] = "",
    points: Annotated[int, typer.Option(min=100, help="Number of points of each scan.")] = 50_000,
    workers: Workers = 2,
    timeout: Timeout = 300,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Run on the Dask cluster at this address, instead of --workers here.")
    ] = "",
    out: RowsFolder = None,
    write: Write = None,
    show: Annotated[bool, typer.Option("--list", help="Only list the cases.")] = False,
    as_json: AsJson = False,
) -> None:
    """Count right, said and silent results on bad scans.

    The troubles are those of real scans: lost walls, skin that was not scanned, a wrong part, frame or unit, fixtures,
    misplaced views, and others. A result is silent where it is wrong, the truth is outside the
    interval, and the site is not doubtful.
    """
    from damageest_evaluate.commands.counted import format_command, run_counted
    from damageest_evaluate.job import fingerprint_code

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places, show_report, split_words
    from damageest_benchmarks.troubles.report import describe_case, format_trouble_row, make_trouble_tables
    from damageest_benchmarks.troubles.suite import make_trouble_cases

    prepare_places(out, write, "honesty")
    source = fingerprint_code(Registry.discover())
    cases = make_trouble_cases(
        split_words(kinds),
        split_words(parts),
        parse_numbers("--seeds", seeds),
        points,
        parse_numbers("--case", case),
        source,
    )
    if show:
        for item in cases:
            typer.echo(f"{item.number} {describe_case(item.make_blank_row())}")
        return

    def describe(row: dict[str, Any]) -> str:
        return f"{row['number']} {format_trouble_row(row)}"

    rows = run_counted(cases, out, "honesty.jsonl", workers, timeout, describe, scheduler)
    show_report(
        lambda legend: make_trouble_tables(rows, format_command(), legend),
        "honesty",
        out,
        write,
        rows,
        as_json,
    )
