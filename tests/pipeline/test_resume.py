"""A run that is killed leaves the earlier output as it was, and the next one goes on from the last finished stage."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import damageest
from damageest.registry import Registry
from damageest.registry.hookspecs import hookimpl
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

damageest.run(sys.argv[1], output=True, registry=Registry.discover([Killer()]), settings=sys.argv[3:])
"""
ROUTE = ["part", "scan", "align", "segment", "cluster", "enclose", "boolean", "allowance", "export", "report"]
SETTINGS = ["cluster.neighbours=9", "tolerance=0.6"]


@pytest.mark.variants(slow=4)
@pytest.mark.slow
@pytest.mark.parametrize("stage", ROUTE)
def test_killed_in(stage: str, small_done: Path, registry: Registry) -> None:
    command = [sys.executable, "-c", DRIVER, str(small_done), stage, *SETTINGS]
    check_killed(
        small_done, ROUTE.index(stage), registry, lambda: subprocess.run(command, capture_output=True).returncode
    )


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_killed_after_the_scan_was_read(small_done: Path, registry: Registry) -> None:
    """Before any stage has run threads, so that a fork can stand for the process that the others start."""
    watched = Registry.discover([Killer()])

    def run() -> int:
        child = os.fork()
        if not child:
            try:
                damageest.run(small_done, output=True, registry=watched, settings=SETTINGS)
            finally:
                os._exit(0)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    check_killed(small_done, 2, registry, run)


class Killer:
    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        if stage == ROUTE[2]:
            os.kill(os.getpid(), signal.SIGKILL)


def check_killed(job: Path, place: int, registry: Registry, run: Callable[[], int]) -> None:
    """``run`` is killed before the stage of `ROUTE` at this place."""
    out = job.parent / "out/job"
    for name in (out / "stages").iterdir():  # so that only what the killed run finished can be found again
        name.unlink()
    before = damaged_box.content(out)
    assert run() == -signal.SIGKILL
    assert damaged_box.content(out) == before
    result = damageest.run(job, output=True, settings=SETTINGS, registry=registry)
    cached = {record.stage: record.cached for record in result.stages}
    kept = [name for name in ROUTE[:place] if name != "export"]  # it writes files each time
    assert [name for name in ROUTE if cached[name]] == kept
    assert json.loads((out / "result.json").read_text())["status"] == "ok"
    assert [p.name for p in out.parent.iterdir()] == ["job"], "nothing is left lying about"


@pytest.mark.slow
def test_another_format_runs_the_export_alone(small_done: Path, registry: Registry) -> None:
    result = damageest.run(small_done, output=True, settings=["export.format=ply"], registry=registry)
    assert [r.stage for r in result.stages if not r.cached] == ["export", "report"]


def test_only_what_depends_on_a_change_runs_again(small_done: Path, registry: Registry) -> None:
    result = damageest.run(small_done, output=True, settings=["enclose.point_weight=2"], registry=registry)
    assert not {r.stage for r in result.stages if not r.cached} & {"part", "scan", "align", "segment", "cluster"}


@pytest.mark.slow
def test_what_is_not_ours_stays(small_done: Path, registry: Registry) -> None:
    notes = small_done.parent / "out/job/notes.txt"
    notes.write_text("mine")
    damageest.run(small_done, output=True, registry=registry)
    assert notes.read_text() == "mine"
    with pytest.raises(damageest.errors.JobError, match="not an earlier output"):
        damageest.run(small_done, output=small_done.parent, registry=registry)


@pytest.mark.slow
def test_a_damaged_cache_is_computed_anew(small_done: Path, small_result: Result, registry: Registry) -> None:
    for file in (small_done.parent / "out/job/stages").glob("segment-*"):
        file.write_bytes(b"\x00garbage")
    result = damageest.run(small_done, output=True, registry=registry)
    assert not next(r for r in result.stages if r.stage == "segment").cached
    assert result.damage_volume == small_result.damage_volume
