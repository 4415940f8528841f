"""A run that is killed leaves the earlier output as it was, and the next one goes on from the last finished stage."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import damageest
from tests import damaged_box

DRIVER = """
import os, signal, sys
from damageest.registry.hookspecs import hookimpl
from damageest.registry import Registry
import damageest

class Killer:
    @hookimpl
    def damageest_before_stage(self, stage):
        if stage == sys.argv[2]:
            os.kill(os.getpid(), signal.SIGKILL)

damageest.run(sys.argv[1], output=True, registry=Registry.discover([Killer()]), settings=["cluster.neighbours=9"])
"""
ROUTE = ["part", "scan", "align", "segment", "cluster", "enclose", "boolean", "allowance", "export", "report"]


@pytest.mark.parametrize(
    "stage",
    [stage if stage in ("enclose",) else pytest.param(stage, marks=pytest.mark.slow) for stage in ROUTE],
)
def test_killed_in(stage: str, tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    out = tmp_path / "out/job"
    for name in (out / "stages").iterdir():  # so that only what the killed run finished can be found again
        name.unlink()
    before = damaged_box.content(out)
    killed = subprocess.run([sys.executable, "-c", DRIVER, str(path), stage], capture_output=True)
    assert killed.returncode == -signal.SIGKILL
    assert damaged_box.content(out) == before
    result = damageest.run(path, output=True, settings=["cluster.neighbours=9"])
    cached = {record.stage: record.cached for record in result.stages}
    place = ROUTE.index(stage)
    assert all(cached[name] for name in ROUTE[:place])
    assert not any(cached[name] for name in ROUTE[place:])
    assert json.loads((out / "result.json").read_text())["status"] == "ok"
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["job"], "nothing is left lying about"


def test_only_what_depends_on_a_change_runs_again(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    result = damageest.run(path, output=True, settings=["export.format=ply"])
    assert [r.stage for r in result.stages if not r.cached] == ["export", "report"]
    result = damageest.run(path, output=True, settings=["enclose.screening=2"])
    assert not {r.stage for r in result.stages if not r.cached} & {"part", "scan", "align", "segment", "cluster"}


def test_what_is_not_ours_stays(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    (tmp_path / "out/job/notes.txt").write_text("mine")
    damageest.run(path, output=True)
    assert (tmp_path / "out/job/notes.txt").read_text() == "mine"
    with pytest.raises(damageest.errors.JobError, match="not an earlier output"):
        damageest.run(path, output=tmp_path)


def test_a_damaged_cache_is_computed_anew(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    for file in (tmp_path / "out/job/stages").glob("segment-*"):
        file.write_bytes(b"\x00garbage")
    result = damageest.run(path, output=True)
    assert not next(r for r in result.stages if r.stage == "segment").cached
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.02)
