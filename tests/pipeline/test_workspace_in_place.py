"""An output folder that cannot be renamed: its content is replaced, whole or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from damageest.pipeline import workspace
from damageest.pipeline.workspace import open_workspace
from tests.pipeline.outputs import files, make


@pytest.fixture(params=["mounted", "bound", "pretended"])
def fixed(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An output folder that cannot be renamed."""
    target = tmp_path / "fixed"
    target.mkdir()
    if request.param == "pretended":
        rename = os.replace

        def refuse(source: str | Path, place: str | Path) -> None:
            if Path(source) == target or Path(place) == target:
                raise OSError(errno.EBUSY, "Device or resource busy", str(source))
            rename(source, place)

        monkeypatch.setattr("os.replace", refuse)
        yield target
        return
    (tmp_path / "volume").mkdir()
    kind = ["-t", "tmpfs", "tmpfs"] if request.param == "mounted" else ["--bind", str(tmp_path / "volume")]
    try:
        done = subprocess.run(["mount", *kind, str(target)], capture_output=True)
    except OSError:
        pytest.skip("there is no mount here")
    if done.returncode:
        pytest.skip(f"nothing can be mounted here: {done.stderr.decode().strip()}")
    try:
        yield target
    finally:
        subprocess.run(["umount", str(target)], check=True)


def test_a_folder_that_cannot_be_renamed_has_its_content_replaced(fixed: Path) -> None:
    (fixed / "lost+found").mkdir()
    make(fixed, "first")
    for name in ("notes.txt", "damage/site-1.gcode"):
        (fixed / name).write_text("mine")
    with open_workspace(fixed) as place:
        assert place.cache.get("align", "k")[0]
        (place.folder / "result.json").write_text("{}")
        (place.folder / "damage.stl").write_text("second")
        place.finish(["align-k"])
    expected = {"result.json": "{}", "damage.stl": "second", "notes.txt": "mine", "damage/site-1.gcode": "mine"}
    assert files(fixed) == expected
    assert sorted(os.listdir(fixed / "stages")) == ["align-k.json", "align-k.npz"]
    assert not [path for path in (*fixed.iterdir(), *fixed.parent.iterdir()) if path.name.startswith(".")]
    with pytest.raises(RuntimeError), open_workspace(fixed):
        raise RuntimeError
    assert files(fixed) == expected


def test_a_folder_that_is_mounted_while_a_run_computes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "out"
    make(target, "first")
    (target / "notes.txt").write_text("mine")
    rename = os.replace
    with open_workspace(target) as place:
        (place.folder / "result.json").write_text("{}")
        (place.folder / "damage.stl").write_text("second")

        def refuse(source: str | Path, to: str | Path) -> None:
            if Path(source) == target:
                raise OSError(errno.EBUSY, "Device or resource busy", str(source))
            rename(source, to)

        monkeypatch.setattr("os.replace", refuse)
        place.finish([])
    assert files(target) == {"result.json": "{}", "damage.stl": "second", "notes.txt": "mine"}
    assert sorted(os.listdir(tmp_path)) == ["out"]


def end_after(moves: int) -> None:
    """Lets this process end at the next move of a file into or out of an output."""
    rename, left = os.replace, moves

    def count(source: str | Path, to: str | Path) -> None:
        nonlocal left
        left -= "result" in Path(source).parts or "old" in Path(to).parts
        if left < 0:
            os._exit(9)
        rename(source, to)

    os.replace = count  # type: ignore[assignment]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_at_any_move_while_the_content_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next run finds the earlier output or the new one, whole, and the user's files."""
    monkeypatch.setattr(workspace, "_can_be_renamed", lambda _: False)
    found = set()
    for moves in range(40):
        target = tmp_path / f"out{moves}"
        target.mkdir()
        make(target, "first")
        for name in ("notes.txt", "damage/mine.txt"):
            (target / name).write_text("mine")
        child = os.fork()
        if not child:
            end_after(moves)
            make(target, "second")
            os._exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        with pytest.raises(RuntimeError), open_workspace(target):
            raise RuntimeError
        now = files(target)
        assert now.pop("notes.txt") == now.pop("damage/mine.txt") == "mine"
        body = now["damage.stl"]
        assert now == {"result.json": "{}", "damage.stl": body, "damage/site-1.stl": body}
        assert not (target / workspace.INSIDE).exists()
        found.add((status, body))
        if not status:
            break
    assert found == {(9, "first"), (9, "second"), (0, "second")}
