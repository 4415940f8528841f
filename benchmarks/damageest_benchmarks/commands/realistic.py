"""`damageest evaluate realistic`: scans as real sensors make them."""

from __future__ import annotations

from typing import Annotated

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    sensors: Annotated[
        str, typer.Option(metavar="A,B", help="Sensors, in full or their beginning. Default: all.")
    ] = "",
    parts: Annotated[str, typer.Option(metavar="A,B", help="Names of parts. Default: all.")] = "",
    case: Annotated[str, typer.Option(metavar="A,B", help="Numbers of cases, from --list.")] = "",
    every: Annotated[int, typer.Option(min=1, help="Take one case of so many.")] = 1,
    points: Annotated[int, typer.Option(min=1000, help="Number of points of each scan.")] = 40_000,
    workers: Workers = 1,
    timeout: Timeout = 600,
    out: RowsFolder = None,
    write: Write = None,
    show: Annotated[bool, typer.Option("--list", help="Only list the cases.")] = False,
    as_json: AsJson = False,
) -> None:
    """Measure results on scans as six real sensors make them.

    Structured light, laser line, time of flight, stereo camera, photogrammetry and tomography scan ten parts from 1 to
    12 views. The job knows the part and the unit: the pose is unknown and the tolerance is auto.
    """
    from damageest_evaluate.commands.counted import format_command, run_counted
    from damageest_evaluate.job import fingerprint_code

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places, show_report, split_words
    from damageest_benchmarks.realistic.report import describe_case, format_realistic_row, make_realistic_report
    from damageest_benchmarks.realistic.suite import make_realistic_cases

    if not show:
        prepare_places(out, write, "realistic")
    source = fingerprint_code(Registry.discover())
    numbers = parse_numbers("--case", case)
    cases = make_realistic_cases(split_words(sensors), split_words(parts), numbers, every, points, source)
    if show:
        for item in cases:
            typer.echo(f"{item.number} {describe_case(item.make_blank_row())}")
        return
    rows = run_counted(cases, out, "realistic.jsonl", workers, timeout, format_realistic_row)
    show_report(
        lambda legend: make_realistic_report(rows, format_command(), legend),
        "realistic",
        out,
        write,
        rows,
        as_json,
    )
