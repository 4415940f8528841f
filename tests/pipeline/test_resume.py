"""A run that is killed leaves the earlier output as it was, and the next one goes on from the last finished stage."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import damageest
from damageest.registry import Registry
from damageest.result import Result
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
    [stage if stage in ("cluster",) else pytest.param(stage, marks=pytest.mark.slow) for stage in ROUTE],
)
def test_killed_in(stage: str, small_done: Path, registry: Registry) -> None:
    out = small_done.parent / "out/job"
    for name in (out / "stages").iterdir():  # so that only what the killed run finished can be found again
        name.unlink()
    before = damaged_box.content(out)
    killed = subprocess.run([sys.executable, "-c", DRIVER, str(small_done), stage], capture_output=True)
    assert killed.returncode == -signal.SIGKILL
    assert damaged_box.content(out) == before
    result = damageest.run(small_done, output=True, settings=["cluster.neighbours=9"], registry=registry)
    cached = {record.stage: record.cached for record in result.stages}
    place = ROUTE.index(stage)
    assert all(cached[name] for name in ROUTE[:place])
    assert not any(cached[name] for name in ROUTE[place:])
    assert json.loads((out / "result.json").read_text())["status"] == "ok"
    assert [p.name for p in out.parent.iterdir()] == ["job"], "nothing is left lying about"


def test_only_what_depends_on_a_change_runs_again(small_done: Path, registry: Registry) -> None:
    result = damageest.run(small_done, output=True, settings=["export.format=ply"], registry=registry)
    assert [r.stage for r in result.stages if not r.cached] == ["export", "report"]
    result = damageest.run(small_done, output=True, settings=["enclose.screening=2"], registry=registry)
    assert not {r.stage for r in result.stages if not r.cached} & {"part", "scan", "align", "segment", "cluster"}


def test_what_is_not_ours_stays(small_done: Path, registry: Registry) -> None:
    notes = small_done.parent / "out/job/notes.txt"
    notes.write_text("mine")
    damageest.run(small_done, output=True, registry=registry)
    assert notes.read_text() == "mine"
    with pytest.raises(damageest.errors.JobError, match="not an earlier output"):
        damageest.run(small_done, output=small_done.parent, registry=registry)


def test_a_damaged_cache_is_computed_anew(small_done: Path, small_result: Result, registry: Registry) -> None:
    for file in (small_done.parent / "out/job/stages").glob("segment-*"):
        file.write_bytes(b"\x00garbage")
    result = damageest.run(small_done, output=True, registry=registry)
    assert not next(r for r in result.stages if r.stage == "segment").cached
    assert result.damage_volume == small_result.damage_volume
