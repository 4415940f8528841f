"""`damageest evaluate family`: scans that are drawn at random, of a kind that other suites have few of."""

from __future__ import annotations

from typing import Annotated

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    families: Annotated[
        list[str] | None, typer.Argument(help="walls, hands, turned, datums, surroundings. Default: all.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Take one draw of so many.")] = 1,
    seeds: Annotated[str, typer.Option(metavar="A,B", help="Seeds of the draws, instead of --every.")] = "",
    workers: Workers = 1,
    timeout: Timeout = 300,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Count right results on random draws of families. Families: walls (300), hands (60), turned (60), datums (40),
    surroundings (40).

    walls: a pit in a wall of 0.6 to 8 mm, scanned from outside, inside or both. hands: the part or its mirror image.
    turned: round parts whose angle one small feature fixes. datums: parts held by sound or worn datums.
    surroundings: two scans of a part on a table, where it was laid down another way.
    """
    from damageest_evaluate.commands.counted import run_counted, show_table
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places, write_measured
    from damageest_benchmarks.families.case import FAMILIES
    from damageest_benchmarks.families.report import describe_row, make_family_cases, make_family_table

    if unknown := [name for name in families or () if name not in FAMILIES]:
        raise InputError(f"there is no family '{unknown[0]}'; there are: {', '.join(FAMILIES)}")
    prepare_places(out, write, "family")
    numbers = parse_numbers("--seeds", seeds) if seeds else []
    cases = make_family_cases(families or (), every, numbers, fingerprint_code(Registry.discover()))
    rows = run_counted(cases, out, "family.jsonl", workers, timeout, describe_row)
    table = format_markdown(make_family_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "family", write)
