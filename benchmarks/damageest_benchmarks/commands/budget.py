"""`damageest evaluate budget`: whether intervals with a certificate hold what they promise."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from damageest_benchmarks.commands._counted import AsJson, RowsFolder, Timeout, Workers, Write


def command(
    draws: Annotated[int, typer.Option(min=1, help="Scans that are drawn of each part.")] = 200,
    parts: Annotated[str, typer.Option(metavar="A,B", help="Names of parts. Default: all five.")] = "",
    batch: Annotated[int, typer.Option(min=1, help="Draws of one part in one process.")] = 25,
    same: Annotated[bool, typer.Option("--same/--other", help="The same damage in all draws of a part.")] = True,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all draws.")] = 0,
    workers: Workers = 2,
    timeout: Timeout = 3600,
    out: RowsFolder = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Count intervals that hold the truth for certified scans. Scans are drawn with the errors that a certificate
    allows.

    Each draw goes through the whole route, the fit of the pose included.
    """
    from damageest_evaluate.commands.counted import format_command, run_counted
    from damageest_evaluate.job import fingerprint_code

    from damageest.errors import InputError, suggest
    from damageest.registry import Registry
    from damageest_benchmarks.budget import PARTS, make_budget_cases, make_budget_table
    from damageest_benchmarks.commands._counted import prepare_places, show_report, split_words

    prepare_places(out, write, "budget")
    names = split_words(parts) or list(PARTS)
    for name in names:
        if name not in PARTS:
            raise InputError(f"--parts: there is no part '{name}'{suggest(name, list(PARTS))}")
    cases = make_budget_cases(names, draws, batch, seed, fingerprint_code(Registry.discover()), same)

    def describe(row: dict[str, Any]) -> str:
        known = [one for one in row["draws"] if not one["error"]]
        inside = [f"{name} {sum(one[f'{name}_in'] for one in known)}" for name in ("volume", "depth")]
        told = row["error"] or f"truth inside of {len(known)}: {', '.join(inside)}"
        return f"{row['part']} {row['seed']}: {told}; {row['seconds']:.0f} s"

    rows = run_counted(cases, out, "budget.jsonl", workers, timeout, describe)
    text = make_budget_table(rows, format_command())
    show_report(lambda _: text, "budget", out, write, rows, as_json)
