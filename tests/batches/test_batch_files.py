"""The table of a batch as files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from damageest.batches.files import keep_picture, write_page, write_tables
from damageest.batches.rows import Row, read_row

EVIL = "<script>alert(1)</script>\n\"quote'"


def make_rows(folder: Path) -> list[Row]:
    good = Row(
        "good",
        "good.yaml",
        str(folder / "good"),
        "ok",
        sites=2,
        verdicts={"proven": 1, "doubtful": 1},
        damage_volume=12.5,
        volume_95=(12.0, 13.0),
        part_volume=100.0,
        units="mm",
        key="abc",
    )
    return [good, Row(EVIL, "bad.yaml", str(folder / "bad"), "refused", error=EVIL, tries=2)]


def test_json_gives_the_rows_back(tmp_path: Path) -> None:
    rows = make_rows(tmp_path)
    write_tables(rows, tmp_path)
    assert [read_row(values) for values in json.loads((tmp_path / "batch.json").read_text())["jobs"]] == rows


def test_csv(tmp_path: Path) -> None:
    write_tables(make_rows(tmp_path), tmp_path)
    with (tmp_path / "batch.csv").open(newline="") as stream:
        first, second = csv.DictReader(stream)
    assert (first["proven"], first["likely"], first["doubtful"]) == ("1", "0", "1")
    assert (first["volume_low"], first["volume_high"]) == ("12.0", "13.0")
    assert second["error"] == EVIL
    assert second["damage_volume"] == ""


def test_page_is_escaped_and_needs_no_network(tmp_path: Path) -> None:
    report = tmp_path / "good/report.html"
    report.parent.mkdir()
    report.write_text("a report of a plugin, with no picture in it")
    keep_picture(report.parent, b"\x89PNG")
    write_page(make_rows(tmp_path), tmp_path)
    text = (tmp_path / "batch.html").read_text()
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(1)" in text
    assert "http" not in text.replace("http-equiv", "")
    assert 'href="good/report.html"' in text
    assert 'src="data:image/png;base64,iVBORw=="' in text
    assert "1 proven, 1 doubtful" in text
    assert "(2 tries)" in text
    keep_picture(report.parent, b"")
    write_page(make_rows(tmp_path), tmp_path)
    assert "<img" not in (tmp_path / "batch.html").read_text()
