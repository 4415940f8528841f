"""`benchmarks/freeze.py`: two checkouts are the same where nothing but times differs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests import damaged_box

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "freeze.py"


def compare(folder: Path, before: object, after: object) -> tuple[int, list[str]]:
    for name, rows in (("before", before), ("after", after)):
        (folder / f"{name}.json").write_text(json.dumps({"job.yaml": rows}))
    words = [sys.executable, str(SCRIPT), "compare", str(folder / "before.json"), str(folder / "after.json")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout.splitlines()


def test_what_differs_is_named_with_its_place(tmp_path: Path) -> None:
    before = {
        "status": 0,
        "text": ["5962 mm³"],
        "files": {"result.json": {"sites": [{"volume": 5962.1}]}, "a.stl": "0a"},
    }
    after = {"status": 0, "text": ["5962 mm³"], "files": {"result.json": {"sites": [{"volume": 5962.2}]}}}
    assert compare(tmp_path, before, before) == (0, ["nothing differs"])
    assert compare(tmp_path, before, after) == (
        1,
        [
            "job.yaml > files > result.json > sites[0] > volume: 5962.1 -> 5962.2",
            'job.yaml > files > a.stl: "0a" -> null',
        ],
    )


@pytest.mark.slow
def test_a_job_gives_the_same_row_twice(tmp_path: Path) -> None:
    job = damaged_box.write_small(tmp_path / "given")
    root = SCRIPT.parents[1]
    for name in ("first", "second"):
        words = [sys.executable, str(SCRIPT), "record", str(root), str(tmp_path / f"{name}.json"), str(job)]
        subprocess.run(words, check=True, capture_output=True)
    first, second = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("first", "second"))
    assert first == second
    assert first["job.yaml"]["status"] == 0
    assert "damage.stl" in first["job.yaml"]["files"]
    assert first["job.yaml"]["files"]["result.json"]["sites"]
