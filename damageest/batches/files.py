"""The rows of a batch as files: batch.csv and batch.json, and the rows that they do not have yet."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from damageest.batches.rows import LEVELS, Row, read_row
from damageest.io.files import read_json

COLUMNS = (
    "name", "outcome", "sites", *LEVELS, "damage_volume", "volume_low", "volume_high", "part_volume", "units",
    "tolerance", "warnings", "reasons", "remedies", "seconds", "megabytes", "tries", "host", "job", "output", "error",
)  # fmt: skip
"""Columns of batch.csv."""
WRITTEN = 1.0
"""Least time between two writes of the tables, in seconds: a write costs as much as there are rows."""
NEW_ROWS = ".batch.rows"
"""Rows since the tables were last written, a line of JSON each, so that a batch that is killed loses none. No job has
a name that begins with a dot."""


class Tables:
    """batch.csv and batch.json of a batch that runs: rows in the order of ``names``, whatever the order in which they
    come. Each row is appended to `NEW_ROWS` at once, the tables are written at most once in `WRITTEN` seconds."""

    def __init__(self, names: Iterable[str], rows: Iterable[Row], folder: Path) -> None:
        self.names, self.folder = list(names), folder
        self.lines = {row.name: _make_lines(row) for row in rows}
        self.are_old = False
        folder.mkdir(parents=True, exist_ok=True)
        self.write()
        self.stream = (folder / NEW_ROWS).open("w", encoding="utf-8")  # the tables have what was in it

    def add(self, rows: Iterable[Row]) -> None:
        """Keeps these rows, and writes the tables where the last time is long enough ago."""
        for row in rows:
            lines = self.lines[row.name] = _make_lines(row)
            self.stream.write(lines[0] + "\n")
            self.are_old = True
        self.stream.flush()
        if self.are_old and time.monotonic() >= self.written + WRITTEN:
            self.write()

    def write(self) -> None:
        """Writes the tables."""
        _write([self.lines[name] for name in self.names if name in self.lines], self.folder)
        self.are_old, self.written = False, time.monotonic()

    def close(self) -> None:
        """Writes the tables for the last time."""
        self.stream.close()
        if self.are_old:
            self.write()
        (self.folder / NEW_ROWS).unlink(missing_ok=True)


def write_tables(rows: Sequence[Row], folder: Path) -> None:
    """Writes batch.csv and batch.json; a reader never sees half of one."""
    folder.mkdir(parents=True, exist_ok=True)
    _write([_make_lines(row) for row in rows], folder)


def read_rows(folder: Path) -> dict[str, Row]:
    """The rows of the batch that was last written to this folder, by name, also where it was killed; none where there
    was none."""
    values: list[Any] = []
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        values += read_json(folder / "batch.json")["jobs"]
    with contextlib.suppress(OSError, ValueError):
        for line in (folder / NEW_ROWS).read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(ValueError, RecursionError):  # the last line, where the batch was killed in it
                values.append(json.loads(line))
    rows = {}
    for one in values:
        with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
            row = read_row(one)
            rows[row.name] = row
    return rows


def _make_lines(row: Row) -> tuple[str, str]:
    """The row as JSON and as CSV."""
    values = row.to_values()
    stream = io.StringIO()
    csv.DictWriter(stream, COLUMNS, lineterminator="\n").writerow(_flatten(row, values))
    return json.dumps(values, allow_nan=False), stream.getvalue()


def _write(lines: Sequence[tuple[str, str]], folder: Path) -> None:
    jobs = ",\n".join(line for line, _ in lines)
    replace_file(folder / "batch.json", f'{{"schema": 1, "jobs": [\n{jobs}\n]}}\n')
    replace_file(folder / "batch.csv", ",".join(COLUMNS) + "\n" + "".join(line for _, line in lines))


def _flatten(row: Row, values: dict[str, Any]) -> dict[str, Any]:
    values = {name: value for name, value in values.items() if name in COLUMNS}
    low, high = row.volume_95 or ("", "")
    values |= {"volume_low": low, "volume_high": "" if high is None else high}
    values |= {"reasons": "; ".join(row.reasons), "remedies": "; ".join(row.remedies)}
    return values | ({level: row.verdicts.get(level, 0) for level in LEVELS} if row.has_result else {})


def replace_file(path: Path, text: str) -> None:
    """Writes a file that a reader never sees half of."""
    scratch = path.with_name(f".{path.name}")
    scratch.write_text(text, encoding="utf-8")
    os.replace(scratch, path)
