"""The output folder: whole or as it was, and what is the user's in it stays."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from damageest.artefacts import Pose
from damageest.errors import DamageestError, InputError, JobError, StageError
from damageest.pipeline import workspace
from damageest.pipeline.workspace import open_workspace
from tests.pipeline.outputs import files, make


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


@pytest.mark.parametrize("error", [StageError("refused"), JobError([]), InputError("bad"), OSError(28, "full")])
@pytest.mark.parametrize("exists", [False, True])
def test_a_failure_in_a_new_folder_keeps_finished_stages_alone(exists: bool, error: Exception, tmp_path: Path) -> None:
    target = tmp_path / "new/out"
    if exists:
        target.mkdir(parents=True)
    with pytest.raises((DamageestError, OSError)), open_workspace(target) as place:  # noqa: PT012 - the block fails
        place.cache.put("align", "k", Pose(np.eye(4)))
        (place.folder / "damage.stl").write_text("half")
        raise error
    assert os.listdir(tmp_path / "new") == ["out"]
    assert os.listdir(target) == ["stages"]
    with open_workspace(target) as place:
        assert place.cache.get("align", "k")[0]
        (place.folder / "result.json").write_text("{}")
        place.finish([])
    assert files(target) == {"result.json": "{}"}


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


NAMES_OF_FOLDERS = ("stages", "damage", "surface", "deposit", "path", "surplus", "doubtful", "truth",
                    "scan_frame", "nominal_frame")  # fmt: skip
NAMES_OF_FILES = ("scan.ply", "adapt.npz", "damage.stl", "report.html", "job.yaml", "result.3mf", "undamaged.step")


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


@pytest.mark.parametrize("what", ["lock", "partial"])
def test_a_folder_or_file_in_the_place_of_the_hidden_ones_is_named(what: str, tmp_path: Path) -> None:
    hidden = tmp_path / ".out.partial"
    if what == "lock":
        (hidden / "lock").mkdir(parents=True)
    else:
        hidden.write_text("mine")
    with pytest.raises(JobError, match=r"\.out\.partial.*cannot be"), open_workspace(tmp_path / "out"):
        pass
