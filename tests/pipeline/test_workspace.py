"""The output folder: whole or as it was, and what is the user's in it stays."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from damageest.artefacts import Pose
from damageest.errors import JobError
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
