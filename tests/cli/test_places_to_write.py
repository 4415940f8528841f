"""A place that cannot be written is said before the work: what is wrong with it, and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from damageest.errors import JobError
from damageest.io.files import check_output_file, moved_into_place
from damageest.pipeline.placing import prepare
from tests import damaged_box
from tests.cli.calls import call


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a file, a folder with the name of a file, and no input that could be read."""
    (tmp_path / "file").write_text("mine")
    for name in ("folder.yaml", "folder.ply", "form.npz"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("nowhere/x.yaml", "there is no folder nowhere for x.yaml; make it (mkdir -p nowhere), or name another file"),
        ("no where/x.yaml", "mkdir -p 'no where'"),
        ("file/x.yaml", "file is a file, not a folder; name another folder"),
        ("folder.yaml", "folder.yaml is a folder; name a file, for example folder.yaml/name.yaml"),
    ],
)
@pytest.mark.parametrize("force", [(), ("--force",)])
def test_init(target: str, said: str, force: tuple[str, ...], home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "inspect_inputs", lambda *_: pytest.fail("the inputs were read"))
    status, text = call("init", "box.stl", "scan.ply", "-o", target, *force)
    assert status == 2
    assert f"--job: {said}" in text or (said in text and "--job: " in text)


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("file/x.ply", "file is a file, not a folder"),
        ("folder.ply", "is a folder; name a file"),
        ("form.ply", "form.npz is a folder; name a file"),
    ],
)
def test_nominal(target: str, said: str, home: Path) -> None:
    status, text = call("nominal", "out", "-o", target)
    assert (status, said in text) == (2, True), text


@pytest.mark.slow
def test_run_and_batch(home: Path) -> None:
    job = damaged_box.write_small(home)
    for words in (["run", job, "-o", "file"], ["run", job, "-o", "file/out"], ["run", job, "--set", "output=file/out"]):
        status, text = call(*words)
        assert (status, "is a file, not a folder" in text or "is a file; name a folder" in text) == (2, True), text
        assert "align" not in text, "a stage ran"
    for target in ("file", "file/out"):
        status, text = call("batch", job, "--out", target)
        assert (status, "is a file, not a folder" in text) == (2, True), text


def test_inspect(home: Path) -> None:
    (home / "out").mkdir()
    (home / "out/record.json").mkdir()
    status, text = call("inspect", "out", "file", "--step", "milled")
    assert status == 2
    assert "record.json is a folder" in text


def test_a_read_only_folder_and_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is read-only to root, as which tests may run."""
    (tmp_path / "x.png").touch()
    monkeypatch.setattr("os.access", lambda path, mode: path == tmp_path)
    with pytest.raises(JobError, match=r"--output: .*x\.png cannot be written: it is read-only; name another file"):
        check_output_file(tmp_path / "x.png", "--output")
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(
        JobError, match=r"--output: the folder .* cannot be written; name another, or change its rights"
    ):
        check_output_file(tmp_path / "new/y.png", "--output")
    with pytest.raises(JobError, match="cannot be written"):
        check_output_file(tmp_path / ("y" * 300), "--output")


def fill_the_disk(target: Path) -> None:
    with moved_into_place(target, "--output") as scratch:
        scratch.write_text("half")
        raise OSError(28, "No space left on device")


def test_an_earlier_file_stays_where_writing_fails(tmp_path: Path) -> None:
    target = tmp_path / "new/x.txt"
    with moved_into_place(target, "--output") as scratch:
        scratch.write_text("first")
    with pytest.raises(JobError, match="No space left"):
        fill_the_disk(target)
    assert {path.name: path.read_text() for path in target.parent.iterdir()} == {"x.txt": "first"}
