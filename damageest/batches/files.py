"""The table of a batch as files: batch.csv, batch.json and batch.html."""

from __future__ import annotations

import csv
import functools
import io
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from damageest.batches.rows import LEVELS, OUTCOMES, Row
from damageest.io.files import embed_png

COLUMNS = (
    "name", "outcome", "sites", *LEVELS, "damage_volume", "volume_low", "volume_high", "part_volume", "units",
    "tolerance", "warnings", "reasons", "remedies", "seconds", "megabytes", "tries", "host", "job", "output", "error",
)  # fmt: skip
"""Columns of batch.csv."""


def write_tables(rows: Sequence[Row], folder: Path) -> None:
    """Writes batch.csv and batch.json; a reader never sees half of one."""
    folder.mkdir(parents=True, exist_ok=True)
    values = {"schema": 1, "jobs": [row.to_values() for row in rows]}
    _replace(folder / "batch.json", json.dumps(values, indent=1, allow_nan=False) + "\n")
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(_flatten(row) for row in rows)
    _replace(folder / "batch.csv", stream.getvalue())


def write_page(rows: Sequence[Row], folder: Path) -> None:
    """Writes batch.html: a table that can be sorted, with links to the reports, in one file without a network."""
    items = [
        {
            "row": row,
            "picture": _read_picture(Path(row.output)) if row.has_result else "",
            "link": _link(row, folder),
            "said": OUTCOMES.get(row.outcome, ""),
        }
        for row in rows
    ]
    counts = {word: sum(row.outcome == word for row in rows) for word in OUTCOMES}
    text = _load_page().render(items=items, counts={word: count for word, count in counts.items() if count})
    folder.mkdir(parents=True, exist_ok=True)
    _replace(folder / "batch.html", text)


@functools.cache
def _load_page() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("damageest.batches", "page")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined).get_template("batch.html")


def _flatten(row: Row) -> dict[str, Any]:
    values = {name: value for name, value in row.to_values().items() if name in COLUMNS}
    low, high = row.volume_95 or ("", "")
    values |= {"volume_low": low, "volume_high": "" if high is None else high}
    values |= {"reasons": "; ".join(row.reasons), "remedies": "; ".join(row.remedies)}
    return values | ({level: row.verdicts.get(level, 0) for level in LEVELS} if row.has_result else {})


def _link(row: Row, folder: Path) -> str:
    """The report of a row, or its result.json, relative to the page; empty where it has neither."""
    for name in ("report.html", "result.json"):
        path = Path(row.output) / name
        if row.has_result and path.is_file():
            return quote(Path(os.path.relpath(path, folder)).as_posix())
    return ""


def keep_picture(output: Path, picture: bytes) -> None:
    """Keeps the PNG that a report gives, beside the job's output folder ``output``; removes it where there is none."""
    path = _place_picture(output)
    if picture:
        path.write_bytes(picture)
    else:
        path.unlink(missing_ok=True)


def _read_picture(output: Path) -> str:
    """The picture of a job for the page; empty where there is none."""
    try:
        return embed_png(_place_picture(output).read_bytes())
    except OSError:
        return ""


def _place_picture(output: Path) -> Path:
    """No job has a name that begins with a dot."""
    return output.with_name(f".{output.name}.png")


def _replace(path: Path, text: str) -> None:
    scratch = path.with_name(f".{path.name}")
    scratch.write_text(text, encoding="utf-8")
    os.replace(scratch, path)
