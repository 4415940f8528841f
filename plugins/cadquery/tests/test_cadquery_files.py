"""The measurement on files of others: what is read back of a written file, and rows that are not made twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from damageest_benchmarks.exact.files import measure_folder, read_back
from damageest_benchmarks.exact.files_rows import count_fair, find_faults, measure_fairly, read_rows, summarise_files
from damageest_cadquery.writing.assembly import NamedShape, write_assembly

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


def write_block(path: Path, nameless: int = 0) -> Path:
    shape = cq.Workplane().box(40, 30, 20).val().wrapped
    names = ["" if number < nameless else f"side {number}" for number in range(6)]
    write_assembly(path, "block", [NamedShape("block", shape, (9, 9, 9), names, [(200, 30, 30)] * 6)], "mm")
    return path


def take_read(path: Path, mesh: float) -> dict[str, Any]:
    return read_back(path, 6) | {"mesh": mesh}


def test_faults_of_a_file_are_found(tmp_path: Path) -> None:
    path = write_block(tmp_path / "whole.step")
    assert find_faults(take_read(path, 24000 * 1.002)) == []
    assert find_faults(take_read(path, 24000 * 1.01)) == ["volume 0.99% from the mesh"]
    assert find_faults(take_read(path, float("nan"))) == ["volume nan% from the mesh"], "unknown is not as wanted"
    assert find_faults(take_read(write_block(tmp_path / "two.step", nameless=2), 24000)) == ["2 faces without a name"]
    read = take_read(path, 24000)
    assert find_faults(read | {"written_solids": 2}) == ["1 solids for 2"]
    assert find_faults(read | {"written_faces": 7, "valid": False}) == ["6 faces for 7", "not valid"]


def test_volumes_are_compared_with_fairer_references_too() -> None:
    damage = {"mesh": 100.0, "volume": 101.0, "by_triangles": 101.0, "fine": 101.0, "chords": 0.9, "truth": 99.0}
    damage |= {"iou_mesh": 0.97, "iou_exact": 0.98}
    deposit = {"mesh": 150.0, "volume": 152.0, "by_triangles": 152.0, "on_own_skin": 151.9}
    site = {"damage": damage, "deposit": deposit}
    assert measure_fairly(site, "damage") == pytest.approx(0.001)
    assert measure_fairly(site, "deposit") == pytest.approx(0.1 / 151.9)
    assert measure_fairly({"deposit": {"mesh": 150.0, "volume": 152.0, "by_triangles": None}}, "deposit") is None
    told = count_fair([site, {"damage": damage | {"chords": 0.0}}])
    assert told[0].startswith("damage: within 0.3% of the mesh 0 of 2; without chords 1 of 2")
    assert told[1].startswith("deposit: within 0.3% of the mesh 0 of 1; from stock on its own skin 1 of 1")
    assert told[2].endswith("exact at least as near on 2 of 2")


@pytest.mark.slow  # 20 s; run it by -m slow
def test_each_file_gets_one_row_and_refused_ones_say_why(tmp_path: Path) -> None:
    pytest.importorskip("damageest_evaluate")
    folder, output = tmp_path / "files", tmp_path / "rows.jsonl"
    folder.mkdir()
    write_block(folder / "block.step")
    cq.exporters.export(cq.Workplane().rect(10, 10).extrude(5).faces(">Z"), str(folder / "open.step"))
    rows = {row["file"]: row for row in measure_folder(folder, output, 0, 120.0)}
    assert rows["open.step"]["kind"] == "refused"
    assert "surfaces only" in rows["open.step"]["error"]
    (site,) = rows["block.step"]["sites"]
    assert find_faults(site["damage"]) == []
    assert site["damage"]["without_colour"] == 0
    assert site["damage"]["chords"] == pytest.approx(0, abs=1e-9 * site["damage"]["mesh"]), "all faces are planes"
    assert measure_fairly(site, "deposit") == pytest.approx(0, abs=1e-3)
    assert list(measure_folder(folder, output, 0, 120.0)) == []
    assert len(read_rows(output)) == 2
    assert "2 files, 1 measured" in summarise_files(read_rows(output))
