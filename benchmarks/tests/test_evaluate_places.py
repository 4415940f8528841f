"""Commands that run for hours say before that where their rows and tables cannot be written."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.calls import call

TABLES = ("suite", "matrix", "speed", "honesty", "budget", "difference", "realistic", "path", "prepare")
FOLDERS = ("suite", "honesty", "budget", "difference", "realistic", "path", "prepare", "steady", "adapt")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "file").write_text("mine")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", TABLES)
def test_a_file_without_marks(name: str, home: Path) -> None:
    more = ("job.yaml",) if name == "matrix" else ()
    status, said = call("evaluate", name, *more, "--write", "file")
    assert (status, "add the lines" in said) == (2, True), said


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_below_a_file(name: str, home: Path) -> None:
    status, said = call("evaluate", name, "--out", "file/rows")
    assert (status, "--out: file is a file, not a folder" in said) == (2, True), said
    assert (home / "file").read_text() == "mine"
