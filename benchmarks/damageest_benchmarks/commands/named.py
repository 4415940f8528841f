"""`damageest evaluate named`: random damages with every background that a job may name."""

from __future__ import annotations

from typing import Annotated

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    backgrounds: Annotated[list[str] | None, typer.Argument(metavar="BACKGROUND...", help="Default: all.")] = None,
    draws: Annotated[int, typer.Option(min=1, help="Number of random damages, on thirteen parts in turn.")] = 40,
    seeds: Annotated[str, typer.Option(metavar="A,B", help="Seeds of the draws, instead of --draws.")] = "",
    workers: Workers = 1,
    timeout: Timeout = 600,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Compare each named background with the default. On random damages with known truth.

    right: an IoU of at least 0.97 of the default's. refused: with a remedy whose run finds the damage.
    """
    from damageest_evaluate.commands.counted import run_counted, show_table
    from damageest_evaluate.job import fingerprint_code
    from damageest_evaluate.tables import format_markdown

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.commands._counted import parse_numbers, prepare_places, write_measured
    from damageest_benchmarks.named import BACKGROUNDS, NamedCase, describe_row, make_named_table

    if unknown := [name for name in backgrounds or () if name not in BACKGROUNDS]:
        raise InputError(f"there is no background '{unknown[0]}'; there are: {', '.join(BACKGROUNDS)}")
    prepare_places(out, write, "backgrounds")
    source, chosen = fingerprint_code(Registry.discover()), tuple(backgrounds or BACKGROUNDS)
    numbers = parse_numbers("--seeds", seeds) if seeds else range(draws)
    cases = [NamedCase(seed, chosen, source) for seed in numbers]
    rows = run_counted(cases, out, "named.jsonl", workers, timeout, describe_row)
    table = format_markdown(make_named_table(rows))
    show_table(table, rows, as_json)
    write_measured(table, "backgrounds", write)
