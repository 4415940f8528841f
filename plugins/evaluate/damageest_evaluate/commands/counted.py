"""What the commands that run many cases share: the folder of --out, counted cases, tables or JSON."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from damageest_evaluate.processes import Row
from damageest_evaluate.rows import EvaluationCase, run_all

AsJson = Annotated[
    bool, typer.Option("--json", help="Print the rows as one line of JSON on standard output, in place of tables.")
]


def prepare_folder(out: Path | None) -> None:
    """Makes the folder ``out``: what is wrong with it is said before the runs. Raises InputError."""
    from damageest.io.files import check_output_folder

    if out:
        check_output_folder(out, "--out")
        out.mkdir(parents=True, exist_ok=True)


def run_counted(
    cases: Sequence[EvaluationCase],
    out: Path | None,
    name: str,
    workers: int,
    timeout: float,
    describe: Callable[[Row], str],
    scheduler: str = "",
) -> list[Row]:
    """The rows of all cases, which the file ``name`` in the folder ``out`` keeps; each is told with its number."""
    prepare_folder(out)
    count = 0

    def print_row(row: Row) -> None:
        nonlocal count
        count += 1
        typer.echo(f"[{count}/{len(cases)}] {describe(row)}", err=True)

    return run_all(cases, out / name if out else None, workers, timeout, print_row, scheduler)


def show_table(text: str, rows: Sequence[Any], as_json: bool) -> None:
    """Prints a table, or with --json the rows that it is made from."""
    from damageest.io.for_programs import format_json

    typer.echo(format_json({"command": format_command(), "rows": rows}) if as_json else f"\n{text}")


def format_command() -> str:
    """The command line, without the options that name output files."""
    words, output_options = sys.argv[1:], ("--out", "--write", "--marks")
    kept = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if before not in output_options and word.partition("=")[0] not in output_options
    ]
    return shlex.join(["damageest", *kept])
