"""What `picture` and `view --window` say where they fail: what is missing, and how to install it."""

from __future__ import annotations

import builtins
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from damageest.errors import DamageestError, StageError, describe_install
from damageest.output import pictures
from damageest.output.folder import OutputFolder, open_output
from damageest.output.pictures import Picture, draw_picture, open_window
from tests.cli.calls import call


@pytest.fixture
def folder(tmp_path: Path) -> OutputFolder:
    (tmp_path / "my out").mkdir()
    (tmp_path / "my out/result.json").write_text('{"sites": [], "units": "mm", "name": "x", "surplus": []}')
    return open_output(tmp_path / "my out")


def without(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def find(name: str, *rest: Any, **more: Any) -> Any:
        if name.partition(".")[0] == module:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", find)


def lose_opengl(**_: object) -> None:
    raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")


def lose_library(**_: object) -> None:
    raise ImportError("libXrender.so.1: cannot open shared object file: No such file or directory")


def fail_in_vtk(**_: object) -> None:
    raise RuntimeError("Failed to load EGL! Please install the EGL library")


def abort(**_: object) -> None:
    os.abort()


def fail_otherwise(**_: object) -> None:
    raise IndexError("list index out of range")


def lose_pyvista(**_: object) -> None:
    raise ModuleNotFoundError("No module named 'pyvista'", name="pyvista")


def lose_pillow(**_: object) -> None:
    raise ModuleNotFoundError("No module named 'PIL'", name="PIL")


@pytest.mark.parametrize(
    ("draw", "said", "remedy"),
    [
        (lose_pyvista, "pyvista is not installed", describe_install("vtk")),
        (lose_pillow, "PIL is not installed", describe_install("report")),
        (lose_opengl, "no OpenGL (libGL.so.1", "apt-get install libegl1"),
        (lose_library, "libXrender.so.1 is missing", "the package that has libXrender.so.1"),
        (fail_in_vtk, "no OpenGL, or its graphics driver failed", "apt-get install libegl1"),
        (fail_otherwise, "IndexError: list index out of range", "--debug"),
    ],
)
def test_what_failed_is_said(
    draw: Callable[..., None], said: str, remedy: str, folder: OutputFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def call_here(function: Callable[..., None], arguments: dict[str, object], **_: object) -> None:
        function(**arguments)

    monkeypatch.setattr(pictures, "call_isolated", call_here)
    monkeypatch.setattr(pictures, "draw_here", draw)
    path = folder.folder / "picture.png"
    path.write_bytes(b"earlier")
    with pytest.raises(StageError) as caught:
        draw_picture(Picture((folder,), (0,)), path)
    assert said in str(caught.value)
    assert remedy in caught.value.remedy
    assert ("OpenGL" in str(caught.value)) == ("OpenGL" in said)
    assert path.read_bytes() == b"earlier"
    assert sorted(one.name for one in folder.folder.iterdir()) == ["picture.png", "result.json"]


def test_a_crash_in_the_other_process_is_said_with_its_signal(
    folder: OutputFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "draw_here", abort)
    with pytest.raises(StageError, match=r"ended by an abort \(SIGABRT\), as on a machine without OpenGL"):
        draw_picture(Picture((folder,), (0,)), folder.folder / "picture.png")
    assert not (folder.folder / "picture.png").exists()


def test_a_window_without_pyvista_names_it(folder: OutputFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":7")
    without("pyvista", monkeypatch)
    with pytest.raises(StageError, match="pyvista is not installed") as caught:
        open_window(folder, 0)
    assert caught.value.remedy == describe_install("vtk")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_without_a_display_the_command_to_copy_is_quoted(folder: OutputFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    status, said = call("view", folder.folder, "--window")
    assert status == 1
    assert f"damageest picture '{folder.folder}' -o picture.png" in said


def test_a_place_that_cannot_be_written_is_said_before_anything_is_drawn(
    folder: OutputFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "call_isolated", lambda *_, **__: pytest.fail("drawn"))
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder.png").mkdir()
    for target, said in (("file/p.png", "is a file, not a folder"), ("folder.png", "is a folder; name a file")):
        status, text = call("picture", folder.folder, "-o", tmp_path / target)
        assert (status, said in text, "--output" in text) == (2, True, True), text
    with pytest.raises(DamageestError, match="is a folder"):
        draw_picture(Picture((folder,), (0,)), tmp_path / "folder.png")
    assert (tmp_path / "file").read_text() == "mine"
