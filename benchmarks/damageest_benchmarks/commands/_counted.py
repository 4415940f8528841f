"""Options that the commands share, and what those need that write tables into pages."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer
from damageest_evaluate.commands.counted import AsJson as AsJson
from damageest_evaluate.commands.counted import prepare_folder, show_table
from damageest_evaluate.commands.job import Timeout as Timeout
from damageest_evaluate.processes import Row

Workers = Annotated[int, typer.Option(min=1, help="Runs at the same time.")]
RowsFolder = Annotated[Path | None, typer.Option(file_okay=False, help="Folder for the rows, to resume from.")]
RowsFile = Annotated[
    Path | None, typer.Option(dir_okay=False, help="JSON Lines file for the rows. A run goes on from it.")
]
Write = Annotated[Path | None, typer.Option(help="Text file. Its lines between the marks are replaced by the table.")]


def split_words(text: str) -> list[str]:
    """The words of an option, which commas separate."""
    return [word.strip() for word in text.split(",") if word.strip()]


def prepare_places(out: Path | None, write: Path | None = None, marks: str = "") -> None:
    """Makes the folder ``out``, and finds the ``marks`` in the file ``write``: what is wrong with them is said before
    the runs. Raises JobError or InputError."""
    from damageest.io.files import check_output_file
    from damageest_benchmarks.readme import replace_between_marks

    if write:
        replace_between_marks(write, None, marks)
        check_output_file(write, "--write")
    prepare_folder(out)


def show_report(
    make: Callable[[bool], str], name: str, out: Path | None, write: Path | None, rows: Sequence[Row], as_json: bool
) -> None:
    """Prints a report, or with --json its rows. Writes it to ``out``/``name``.md, and between the marks ``name`` of the
    file ``write``, there without its legend. ``make`` makes it, with a legend or without."""
    from damageest_benchmarks.readme import replace_between_marks

    text = make(True)
    show_table(text, rows, as_json)
    if out:
        (out / f"{name}.md").write_text(text + "\n", encoding="utf-8")
    if write:
        write.write_text(replace_between_marks(write, make(False), name), encoding="utf-8")


def write_measured(table: str, name: str, write: Path | None) -> None:
    """Writes a table between the marks ``name`` of the file ``write``, with the command and the versions below it."""
    from damageest_evaluate.tables import describe_measurement

    from damageest_benchmarks.readme import replace_between_marks

    if write:
        measured = describe_measurement(f"`{shlex.join(['damageest', *_leave_out_files(sys.argv[1:])])}`")
        write.write_text(replace_between_marks(write, f"{table}\n\n{measured}", name), encoding="utf-8")


def _leave_out_files(words: list[str]) -> list[str]:
    """The words of a command without the files of this machine, --write and --out."""
    files = {"--write", "--out"}
    pairs = zip(["", *words], words, strict=False)
    return [word for before, word in pairs if before not in files and word.partition("=")[0] not in files]


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
