"""The table of a batch as files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from damageest.batches import files
from damageest.batches.files import NEW_ROWS, Tables, read_rows, write_tables
from damageest.batches.rows import Row, read_row
from damageest.batches.run import batch
from damageest.errors import JobError

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


def test_a_batch_that_is_killed_loses_no_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables are not written for each row, which would cost the square of their number; the rows are kept."""
    monkeypatch.setattr(files, "WRITTEN", 1e9)
    rows = [Row(f"job-{k}", "job.yaml", str(tmp_path / f"job-{k}"), "ok") for k in range(4)]
    tables = Tables([row.name for row in rows], rows[:1], tmp_path)
    tables.add([rows[2]])
    tables.add([rows[1]])
    assert len(json.loads((tmp_path / "batch.json").read_text())["jobs"]) == 1
    with (tmp_path / NEW_ROWS).open("a") as stream:
        stream.write('{"name": "job-3", "jo')  # killed while it wrote the fourth
    assert list(read_rows(tmp_path).values()) == [rows[0], rows[2], rows[1]]
    tables.add([rows[3]])
    tables.close()
    assert list(read_rows(tmp_path).values()) == rows, "in the order of the jobs"
    with (tmp_path / "batch.csv").open(newline="") as stream:
        assert [line["name"] for line in csv.DictReader(stream)] == [row.name for row in rows]
    assert not (tmp_path / NEW_ROWS).exists()


def test_tables_are_written_while_a_batch_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "WRITTEN", 0.0)
    tables = Tables(["a"], [], tmp_path)
    tables.add([Row("a", "a.yaml", str(tmp_path / "a"), "ok")])
    assert len(json.loads((tmp_path / "batch.json").read_text())["jobs"]) == 1
    tables.close()


@pytest.mark.needs("distributed")
@pytest.mark.parametrize("output", ["job.yaml/out", "a" * 300])
def test_a_place_that_cannot_be_written_is_named_before_anything_runs(output: str, tmp_path: Path) -> None:
    (tmp_path / "job.yaml").write_text("version: 1\n")
    with pytest.raises(JobError, match=r"cannot be written|is a file, not a folder"):
        batch(tmp_path / "job.yaml", output=tmp_path / output)


def test_an_old_table_of_any_depth_is_none(tmp_path: Path) -> None:
    (tmp_path / "batch.json").write_text("[" * 200_000)
    (tmp_path / NEW_ROWS).write_text("[" * 200_000 + "\n")
    assert read_rows(tmp_path) == {}
