"""Who is answered, and which files are reached."""

from __future__ import annotations

from pathlib import Path

import pytest
from damageest_app.folder import Folder
from damageest_app.security import Guard, confine, make_token
from damageest_app.transfers import clean_name

from damageest.errors import InputError
from damageest.registry import Registry


@pytest.fixture
def guard() -> Guard:
    made = Guard(make_token())
    made.port = 8000
    return made


def test_the_own_page_is_answered(guard: Guard) -> None:
    assert guard.find_fault("127.0.0.1:8000", None, guard.token) == ""
    assert guard.find_fault("localhost:8000", "http://localhost:8000", guard.token) == ""


@pytest.mark.parametrize(
    ("host", "origin", "token"),
    [
        ("attacker.example:8000", None, "own"),  # a name that was pointed at this machine
        ("127.0.0.1:9000", None, "own"),
        ("", None, "own"),
        ("127.0.0.1:8000", "http://attacker.example", "own"),
        ("127.0.0.1:8000", "null", "own"),
        ("127.0.0.1:8000", "http://127.0.0.1:9000", "own"),
        ("127.0.0.1:8000", None, "another"),
        ("127.0.0.1:8000", None, None),
        ("127.0.0.1:8000", None, "é"),
    ],
)
def test_others_are_refused(guard: Guard, host: str, origin: str | None, token: str | None) -> None:
    assert guard.find_fault(host, origin, guard.token if token == "own" else token)


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "a/../../secret", "link/secret", "a\x00b", "~root"])
def test_files_outside_of_the_folder_are_not_reached(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "secret").write_text("x")
    (folder / "link").symlink_to(tmp_path)
    try:
        found = confine(folder, name)
    except InputError:
        return
    assert folder.resolve() in found.parents


def test_a_dropped_file_is_a_part_a_scan_or_a_job_in_the_folder(tmp_path: Path, registry: Registry) -> None:
    folder = Folder.open(tmp_path, registry)
    assert clean_name("..\\..\\scan.ply", folder) == "scan.ply"
    assert clean_name("/tmp/../part 1.stl", folder) == "part 1.stl"
    for name in ("run.sh", "page.html", "", ".stl", "....ply"):
        with pytest.raises(InputError, match="no part and no scan"):
            clean_name(name, folder)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path, registry: Registry) -> None:
    with pytest.raises(InputError, match="no such folder"):
        Folder.open(tmp_path / "none", registry)
