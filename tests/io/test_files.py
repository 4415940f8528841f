"""Errors while a file is read that are not the file's fault, and paths below a home folder."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from damageest.errors import InputError, StageError
from damageest.io.files import expand_home
from damageest.io.meshes import read_mesh
from damageest.io.points import ply, read_points

LIBRARY = "libGLU.so.1: cannot open shared object file: No such file or directory"
INTERRUPTED = ImportError("initialization failed")
INTERRUPTED.__cause__ = KeyboardInterrupt()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a.ply"
    trimesh.creation.box().export(path)
    return path


@pytest.fixture(params=[read_mesh, read_points], ids=["mesh", "points"])
def read_with(request: pytest.FixtureRequest, path: Path, monkeypatch: pytest.MonkeyPatch):
    """Reads a file; the library that does so raises the error given."""

    def read(error: BaseException) -> None:
        def fail(*args: object, **options: object) -> None:
            raise error

        monkeypatch.setattr(trimesh, "load_scene", fail)
        monkeypatch.setattr(ply, "read_vertices", fail)
        request.param(path)

    return read


@pytest.mark.parametrize(
    ("error", "text", "remedy"),
    [
        (ModuleNotFoundError("No module named 'lxml.etree'", name="lxml.etree"), "Python module lxml.etree", "lxml"),
        (ImportError(LIBRARY), "the system library libGLU.so.1 is missing", "package that has libGLU.so.1"),
        (OSError(LIBRARY), "the system library libGLU.so.1 is missing", "package that has libGLU.so.1"),
        (ImportError("cannot import name 'a'"), "cannot be loaded: cannot import name 'a'", "install it again"),
    ],
)
def test_a_library_that_does_not_load_is_named_and_not_the_file(read_with, error, text, remedy) -> None:
    with pytest.raises(StageError) as caught:
        read_with(error)
    assert text in caught.value.message
    assert remedy in caught.value.remedy
    assert "readable" not in str(caught.value)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), INTERRUPTED])
def test_an_interrupt_stays_one(read_with, error) -> None:
    with pytest.raises(KeyboardInterrupt):
        read_with(error)


@pytest.mark.parametrize("error", [ValueError("odd"), OSError(5, "Input/output error"), IndexError("7")])
def test_other_errors_are_the_files(read_with, error) -> None:
    with pytest.raises(InputError, match=r"a\.ply: cannot be read as a \.ply"):
        read_with(error)


def test_a_home_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    assert expand_home(Path("~/a.stl")) == Path("/home/me/a.stl")
    assert expand_home(Path("~nobody-of-this-name/a.stl")) == Path("~nobody-of-this-name/a.stl")
