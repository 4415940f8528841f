"""batch.html: the rows of a batch as a page that can be sorted and searched, also where there are ten thousand."""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from damageest.batches.files import replace_file
from damageest.batches.rows import OUTCOMES, Row
from damageest.io.files import embed_png

MOST_PICTURES = 16_000_000
"""Characters of pictures in the page. Those of further rows are read from their files, beside the page."""


def write_page(rows: Sequence[Row], folder: Path) -> None:
    """Writes batch.html, in one file without a network: first the jobs with a doubtful site, then those that did not
    run. The page draws a row when it is scrolled to."""
    counts = {word: sum(row.outcome == word for row in rows) for word in OUTCOMES}
    items, size = [], 0
    for row in sorted(rows, key=_rank):
        item = _describe(row, folder)
        item["picture"] = _find_picture(Path(row.output), folder, size < MOST_PICTURES) if row.has_result else ""
        size += len(item["picture"])
        items.append(item)
    said = {word: (count, OUTCOMES[word]) for word, count in counts.items() if count}
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "batch.html", _load_page().render(items=items, counts=said))


def _rank(row: Row) -> int:
    """What a person has to look at comes first."""
    return 0 if row.verdicts.get("doubtful") else 1 if not row.ran else 2


def _describe(row: Row, folder: Path) -> dict[str, Any]:
    """The row as the page's script reads it."""
    tries = f" ({row.tries} tries)" if row.tries > 1 else ""
    item: dict[str, Any] = {
        "name": row.name,
        "link": _link(row, folder),
        "outcome": row.outcome,
        "verdict": row.verdict,
        "doubtful": row.verdicts.get("doubtful", 0),
        "seconds": row.seconds,
        "notes": row.warnings,
        "error": row.error + tries,
        "reasons": "; ".join(row.reasons),
    }
    if row.has_result:
        low, high = row.volume_95 or (None, None)
        interval = "" if low is None else f"at least {low:.4g}" if high is None else f"{low:.4g} to {high:.4g}"
        item |= {"sites": row.sites, "volume": row.damage_volume, "low": low, "interval": interval}
        item |= {"amount": "" if row.damage_volume is None else f"{row.damage_volume:.5g} {row.units}³"}
    return item


@functools.cache
def _load_page() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("damageest.batches", "page")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined).get_template("batch.html")


def _link(row: Row, folder: Path) -> str:
    """The report of a row, or its result.json, relative to the page; empty where it has neither."""
    for name in ("report.html", "result.json"):
        path = Path(row.output) / name
        if row.has_result and path.is_file():
            return _relate(path, folder)
    return ""


def _relate(path: Path, folder: Path) -> str:
    return quote(Path(os.path.relpath(path, folder)).as_posix())


def keep_picture(output: Path, picture: bytes) -> None:
    """Keeps the PNG that a report gives, beside the job's output folder ``output``; removes it where there is none."""
    path = _place_picture(output)
    if picture:
        path.write_bytes(picture)
    else:
        path.unlink(missing_ok=True)


def _find_picture(output: Path, folder: Path, embed: bool) -> str:
    """The picture of a job, in the page or as a file beside it; empty where there is none."""
    path = _place_picture(output)
    if not embed:
        return _relate(path, folder) if path.is_file() else ""
    try:
        return embed_png(path.read_bytes())
    except OSError:
        return ""


def _place_picture(output: Path) -> Path:
    """No job has a name that begins with a dot."""
    return output.with_name(f".{output.name}.png")
