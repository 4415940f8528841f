"""The output folder: whole or as it was, and what is the user's in it stays."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from damageest.artefacts import Pose
from damageest.errors import JobError
from damageest.pipeline import workspace
from damageest.pipeline.workspace import open_workspace


def make(target: Path, body: str) -> None:
    """One finished output, its damage file holding ``body``."""
    with open_workspace(target) as place:
        place.cache.put("align", "k", Pose([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
        (place.folder / "result.json").write_text("{}")
        (place.folder / "damage.stl").write_text(body)
        (place.folder / "damage").mkdir()
        (place.folder / "damage/site-1.stl").write_text(body)
        place.finish(["align-k"])


def files(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file() and "stages" not in p.parts
    }


def test_a_new_output_replaces_the_old_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "out/x"
    make(target, "first")
    with open_workspace(target) as place:
        (place.folder / "result.json").write_text("{}")
        place.finish([])
    assert files(target) == {"result.json": "{}"}, "a site that is gone leaves no file behind"
    assert os.listdir(tmp_path / "out") == ["x"]


def test_the_users_own_files_stay(tmp_path: Path) -> None:
    target = tmp_path / "out"
    make(target, "first")
    mine = ["notes.txt", "damage.gcode", "scan.notes.txt", "damage/site-1.gcode", "deposit/plan/a.txt", "stage.txt"]
    for name in mine:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).write_text("mine")
    make(target, "second")
    now = files(target)
    assert {name for name, body in now.items() if body == "mine"} == set(mine)
    assert now["damage.stl"] == now["damage/site-1.stl"] == "second"


@pytest.mark.parametrize("moved", [False, True])
def test_killed_while_finishing(moved: bool, tmp_path: Path) -> None:
    """Between the two renames there is no output but the old one; after them, the user's files are still in the old."""
    target, old = tmp_path / "out", tmp_path / ".out.old"
    make(target, "first")
    (target / "notes.txt").write_text("mine")
    os.replace(target, old)
    if moved:
        make(tmp_path / "other", "second")
        os.replace(tmp_path / "other", target)
    with pytest.raises(RuntimeError), open_workspace(target):
        raise RuntimeError
    assert files(target)["damage.stl"] == ("second" if moved else "first")
    assert files(target)["notes.txt"] == "mine"
    assert not old.exists()


def test_a_failure_leaves_the_old_and_keeps_finished_stages(tmp_path: Path) -> None:
    target = tmp_path / "out"
    make(target, "first")
    before = files(target)
    with pytest.raises(RuntimeError), open_workspace(target) as place:  # noqa: PT012 - what fails is the block itself
        place.cache.put("align", "later", Pose(place.cache.get("align", "k")[1].T_part_scan))
        (place.folder / "damage.stl").write_text("half")
        raise RuntimeError
    assert files(target) == before
    with open_workspace(target) as place:
        assert place.cache.get("align", "later")[0]
        assert os.listdir(place.folder) == []
    with open_workspace(target, use_cache=False) as place:
        assert not place.cache.get("align", "later")[0]
        assert not place.cache.get("align", "k")[0]


def test_a_failure_without_a_finished_stage_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), open_workspace(tmp_path / "out"):
        raise RuntimeError
    assert os.listdir(tmp_path) == []


def test_only_one_run_at_a_time(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    with (
        open_workspace(tmp_path / "out"),
        pytest.raises(JobError, match="another run is writing"),
        open_workspace(tmp_path / "out"),
    ):
        pass
    with open_workspace(tmp_path / "out"):
        pass


def test_what_is_someone_elses_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder/a").write_text("mine")
    (tmp_path / "empty").mkdir()
    for name, why in {"file": "is a file", "folder": "not an earlier output"}.items():
        with pytest.raises(JobError, match=why), open_workspace(tmp_path / name):
            pass
    make(tmp_path / "empty", "first")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["empty", "file", "folder"]


NAMES_OF_FOLDERS = ("stages", "damage", "surface", "deposit", "path", "surplus", "doubtful", "truth", "scan_frame")
NAMES_OF_FILES = ("scan.ply", "damage.stl", "report.html", "job.yaml", "result.3mf", "undamaged.step")


@pytest.mark.parametrize("kind", ["file", "link", "dead link"])
@pytest.mark.parametrize("name", NAMES_OF_FOLDERS)
def test_an_own_file_in_the_place_of_a_folder_is_refused_before_anything_is_computed(
    name: str, kind: str, tmp_path: Path
) -> None:
    target = tmp_path / "out"
    make(target, "first")
    shutil.rmtree(target / name, ignore_errors=True)
    if kind == "file":
        (target / name).write_text("mine")
    else:
        (tmp_path / "elsewhere").mkdir()
        (target / name).symlink_to(tmp_path / "elsewhere" if kind == "link" else tmp_path / "nowhere")
    before = sorted(path.name for path in target.iterdir())
    with pytest.raises(JobError, match=f"{name} is a (file|link), but a run writes a folder"), open_workspace(target):
        pytest.fail("nothing is to be computed")
    assert sorted(path.name for path in target.iterdir()) == before
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    (target / name).unlink()
    make(target, "second")
    assert files(target)["damage.stl"] == "second"


@pytest.mark.parametrize("name", NAMES_OF_FILES)
def test_an_own_folder_in_the_place_of_a_file_is_refused(name: str, tmp_path: Path) -> None:
    target = tmp_path / "out"
    make(target, "first")
    (target / name).unlink(missing_ok=True)
    (target / name).mkdir()
    (target / name / "notes.txt").write_text("mine")
    with pytest.raises(JobError, match="is a folder, but a run writes a file"), open_workspace(target):
        pytest.fail("nothing is to be computed")
    assert (target / name / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("mine", ["dose.txt/a.txt", "extra", "damage/site-2.stl/a.txt", "dose.txt"])
def test_a_name_that_a_run_takes_unforeseen_loses_nothing(
    mine: str, inside: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a plugin's format: the user has a folder where it writes a file, a file where it writes a folder, or a file
    of the same name."""
    target = tmp_path / "out"
    make(target, "first")
    (target / mine).parent.mkdir(parents=True, exist_ok=True)
    (target / mine).write_text("mine")
    if inside:
        monkeypatch.setattr(workspace, "_can_be_renamed", lambda _: False)
    with pytest.warns(UserWarning, match="your own file is kept as"), open_workspace(target) as place:  # noqa: PT031
        for name in ("result.json", "dose.txt", "extra/a.bin", "damage/site-2.stl"):
            (place.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (place.folder / name).write_text("{}")
        place.finish([])
    now = files(target)
    assert list(now.values()).count("mine") == 1
    assert all(now[name] == "{}" for name in ("result.json", "dose.txt", "extra/a.bin", "damage/site-2.stl"))


def test_an_output_that_an_older_version_left_in_two_is_mended(tmp_path: Path) -> None:
    """It refused the user's file only after the new output was in place."""
    target = tmp_path / "out"
    make(target, "second")
    (tmp_path / ".out.old").mkdir()
    (tmp_path / ".out.old/stages").write_text("mine")
    with pytest.warns(UserWarning, match="kept as stages"):
        make(target, "third")
    assert sorted(files(target).values()) == ["mine", "third", "third", "{}"]
    assert not (tmp_path / ".out.old").exists()


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


@pytest.mark.parametrize("what", ["lock", "partial"])
def test_a_folder_or_file_in_the_place_of_the_hidden_ones_is_named(what: str, tmp_path: Path) -> None:
    hidden = tmp_path / ".out.partial"
    if what == "lock":
        (hidden / "lock").mkdir(parents=True)
    else:
        hidden.write_text("mine")
    with pytest.raises(JobError, match=r"\.out\.partial.*cannot be"), open_workspace(tmp_path / "out"):
        pass
