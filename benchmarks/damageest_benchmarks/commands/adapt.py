"""`damageest evaluate adapt`: parts that are bent, twisted, scaled and worn, with known loss."""

from __future__ import annotations

from typing import Annotated

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers


def command(
    groups: Annotated[
        str, typer.Option(metavar="A,B", help="damaged, lost end, seen in part, large loss, whole, worn. Default: all.")
    ] = "",
    only: Annotated[str, typer.Option(metavar="TEXT", help="Only cases with this in their name.")] = "",
    use: Annotated[str, typer.Option(metavar="A,B", help="straight, none, auto, plain, drift. Default: all.")] = "",
    every: Annotated[int, typer.Option(min=1, help="Take one case of so many.")] = 1,
    points: Annotated[int, typer.Option(min=1000, help="Number of points of each scan.")] = 120_000,
    workers: Workers = 1,
    timeout: Timeout = 300,
    out: RowsFolder = None,
    as_json: AsJson = False,
) -> None:
    """Measure the stage adapt on deformed parts. Their loss is known; compared with rigid and plain fits and parts as
    designed."""
    from damageest_evaluate.commands.counted import run_counted
    from damageest_evaluate.job import fingerprint_code

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.adapting.report import format_adapting_row, make_adapting_table
    from damageest_benchmarks.adapting.suite import GROUPS, USES, make_adapting_cases
    from damageest_benchmarks.commands._counted import split_words

    chosen = {"--groups": (split_words(groups), GROUPS), "--use": (split_words(use), USES)}
    for option, (given, known) in chosen.items():
        if wrong := [name for name in given if name not in known]:
            raise InputError(f"{option}: there is no '{wrong[0]}'; there are: {', '.join(known)}")
    cases = make_adapting_cases(split_words(groups), only, points, fingerprint_code(Registry.discover()))
    names = list(dict.fromkeys((case.group, case.name) for case in cases))[::every]
    uses = split_words(use) or USES
    cases = [case for case in cases if (case.group, case.name) in names and case.use in uses]
    rows = run_counted(cases, out, "adapt.jsonl", workers, timeout, format_adapting_row)
    show_table(make_adapting_table(rows), rows, as_json)
