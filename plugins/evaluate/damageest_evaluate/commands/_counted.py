"""What the commands that run many cases share."""

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


def split_words(text: str) -> list[str]:
    """The words of an option, which commas separate."""
    return [word.strip() for word in text.split(",") if word.strip()]


def prepare_places(out: Path | None, write: Path | None = None, marks: str = "") -> None:
    """Makes the folder ``out``, and finds the ``marks`` in the file ``write``: what is wrong with them is said before
    the runs. Raises JobError or InputError."""
    from damageest.io.files import check_output_file, check_output_folder
    from damageest_evaluate.readme import replace_between_marks

    if write:
        replace_between_marks(write, None, marks)
        check_output_file(write, "--write")
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
    prepare_places(out)
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


def show_report(
    make: Callable[[bool], str], name: str, out: Path | None, write: Path | None, rows: Sequence[Row], as_json: bool
) -> None:
    """Prints a report, or with --json its rows. Writes it to ``out``/``name``.md, and between the marks ``name`` of the
    file ``write``, there without its legend. ``make`` makes it, with a legend or without."""
    from damageest_evaluate.readme import replace_between_marks

    text = make(True)
    show_table(text, rows, as_json)
    if out:
        (out / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    if write:
        write.write_text(replace_between_marks(write, make(False), name), encoding="utf-8")


def write_measured(table: str, name: str, write: Path | None) -> None:
    """Writes a table between the marks ``name`` of the file ``write``, with the command and the versions below it."""
    from damageest_evaluate.readme import describe_measurement, replace_between_marks

    if write:
        words = [word for word in sys.argv[1:] if not word.startswith("--write")]
        measured = describe_measurement(f"`{shlex.join(['damageest', *words])}`")
        write.write_text(replace_between_marks(write, f"{table}\n\n{measured}", name), encoding="utf-8")


def parse_numbers(option: str, text: str) -> list[int]:
    """The whole numbers in ``text``; raises InputError for anything else."""
    from damageest.errors import InputError

    try:
        values = [int(word) for word in split_words(text)]
    except ValueError:
        values = [-1]
    if any(value < 0 for value in values):
        raise InputError(f"{option}: '{text}' is not valid; give whole numbers separated by commas, for example 0,1,2")
    return values or ([0] if option == "--seeds" else [])


def format_command() -> str:
    """The command line, without the options that name output files."""
    words, output_options = sys.argv[1:], ("--out", "--write", "--marks")
    kept = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if before not in output_options and word.partition("=")[0] not in output_options
    ]
    return shlex.join(["damageest", *kept])
