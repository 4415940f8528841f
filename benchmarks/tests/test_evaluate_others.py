"""`damageest evaluate others`: files of parts by others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from damageest_benchmarks.others import POINTS, make_file_cases, make_others_table
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError
from damageest.io.meshes import write_stl
from tests.damaged_box import box


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_stl(tmp_path / "box.stl", box())
    (tmp_path / "open.stl").write_bytes((tmp_path / "box.stl").read_bytes()[:-50])
    (tmp_path / "notes.txt").write_text("no part")
    return tmp_path


def test_each_file_of_a_part_is_a_case(folder: Path) -> None:
    whole, broken = make_file_cases(folder, 1, "source")
    assert (whole.part, broken.part) == ("box.stl", "open.stl")
    assert whole.compute_key() != broken.compute_key() != make_file_cases(folder, 2, "source")[1].compute_key()
    row = broken.run()
    assert row["skipped"]
    assert "open.stl" in row["error"]


@pytest.mark.slow
def test_noise_and_tolerance_follow_from_the_size(folder: Path) -> None:
    case = make_file_cases(folder, 0, "source")[0]
    assert case.scanner["points"] == POINTS
    row = replace(case, scanner={**case.scanner, "points": 15_000}).run()
    assert row["noise"] == pytest.approx(0.0004 * row["diagonal"])
    assert row["tolerance"] == pytest.approx(0.0015 * row["diagonal"], rel=1e-3)
    assert row["iou"] > 0.9


def test_a_stage_that_takes_far_longer_than_on_other_parts_is_named() -> None:
    row = {
        "part": "a.stl", "error": "", "skipped": False, "stage_seconds": {"align": 1.0, "enclose": 2.0},
        "kinds": ["pit"], "pose_error": 0.1, "tolerance": 0.2, "sites": 1,
        "iou": 0.99, "seconds": 4.0, "reasons": [], "triangles": 12,
    }  # fmt: skip
    slow = row | {"part": "b.stl", "stage_seconds": {"align": 9.0, "enclose": 2.0}}
    bad = row | {"part": "c.stl", "error": "not | watertight", "skipped": True, "triangles": None}
    ended = {name: value for name, value in row.items() if name != "triangles"} | {"error": "was ended"}
    assert make_others_table([row, ended])[-1][-1] == "was ended"
    lines = make_others_table([row, row, slow, bad])
    assert [line[-2] for line in lines[1:]] == ["", "", "align 9 s", ""]
    assert lines[-1][-1] == "no part: not / watertight"
    assert {len(line) for line in lines} == {len(lines[0])}


def test_a_folder_without_parts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no part"):
        CliRunner().invoke(app, ["evaluate", "others", str(tmp_path)], catch_exceptions=False)
