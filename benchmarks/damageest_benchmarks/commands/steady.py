"""`damageest evaluate steady`: whether the same part, scanned again, gets the same verdicts."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers


def command(
    case: Annotated[str, typer.Option(metavar="A,B", help="Numbers of cases of the honesty suite. Default: 26.")] = "",
    points: Annotated[int, typer.Option(min=100, help="Number of points of each scan.")] = 30_000,
    workers: Workers = 2,
    timeout: Timeout = 900,
    out: RowsFolder = None,
    as_json: AsJson = False,
) -> None:
    """Draw scans again and compare the verdicts.

    Each scan is drawn again with other points, half the points, in another frame, and with a tolerance that is 10 %
    larger. The command searches the sites of the first run in the others.
    """
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.rows import run_all
    from damageest_evaluate.tables import format_markdown

    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places
    from damageest_benchmarks.troubles.steady import NUMBERS, SteadyCase, make_steady_table
    from damageest_benchmarks.troubles.suite import make_trouble_cases

    source = fingerprint_code(Registry.discover())
    numbers = parse_numbers("--case", case) or list(NUMBERS)
    cases = [SteadyCase(**vars(one)) for one in make_trouble_cases(points=points, numbers=numbers, source=source)]
    prepare_places(out)

    def print_row(row: dict[str, Any]) -> None:
        flips = [f"{one['draw']}: {one['before']} -> {one['after']}" for one in row["sites"]]
        told = "; ".join(dict.fromkeys(flips)) or row["error"] or "no site"
        typer.echo(f"{row['number']} {row['kind']}: {row['part']}: {told}, {row['seconds']:.0f} s", err=True)

    rows = run_all(cases, out / "steady.jsonl" if out else None, workers, timeout, print_row)
    show_table(format_markdown(make_steady_table(rows)), rows, as_json)
