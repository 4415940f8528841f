"""The process for exact solids: it ends with the one that started it, and one site that fails costs no other."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

HANG = """
import os, sys
from pathlib import Path
import damageest_cadquery._worker as worker
def hang(path):
    Path(sys.argv[0]).with_name("worker.pid").write_text(str(os.getpid()))
    while True:
        pass
worker.main = hang
worker.start(sys.argv[1:])
"""
PARENT = """
import subprocess, sys
from damageest_cadquery import exact
start = subprocess.Popen
exact.subprocess.Popen = lambda command, **options: start([command[0], sys.argv[1], *command[-2:]], **options)
exact._run(exact.Request(None, 1.0, 1.0, "mm", (), {}, "", "", {}, {}), 600.0)
"""


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_the_process_ends_with_the_one_that_started_it(how: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "hang.py").write_text(HANG)
    (tmp_path / "parent.py").write_text(PARENT)
    command = [sys.executable, str(tmp_path / "parent.py"), str(tmp_path / "hang.py")]
    parent = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    told = tmp_path / "worker.pid"
    try:
        wait_for(lambda: told.is_file() and bool(told.read_text()), 120)
        worker = int(told.read_text())
        parent.send_signal(how)
        parent.wait(timeout=30)
        try:
            wait_for(lambda: not is_running(worker), 30)
        finally:
            if is_running(worker):
                os.kill(worker, signal.SIGKILL)
    finally:
        parent.kill()
        parent.wait()


def test_a_terminated_run_leaves_no_process_at_its_export(tmp_path: Path) -> None:
    """The whole command, stopped while OpenCASCADE works in a process of a process of its own."""
    cq.exporters.export(cq.Workplane().box(20, 20, 12), str(tmp_path / "block.step"))
    job = {
        "version": 1, "units": "mm", "tolerance": 0.3, "part": str(tmp_path / "block.step"), "align": "none",
        "scan": {
            "use": "simulate", "points": 12000, "noise": 0.05, "seed": 4,
            "damage": [{"tool": "sphere", "centre": [-10, 0, 6], "radius": 4}],
        },
        "export": {"format": ["step"]}, "report": "none",
    }  # fmt: skip
    (tmp_path / "job.yaml").write_text(json.dumps(job))
    command = [sys.executable, "-c", "from damageest.cli import main; main()", "run", str(tmp_path / "job.yaml")]
    run = subprocess.Popen(
        [*command, "-o", str(tmp_path / "out")], env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    workers: list[int] = []

    def is_seen() -> bool:
        workers.extend(find_workers(tmp_path))
        return bool(workers) or run.poll() is not None

    try:
        wait_for(is_seen, 120)
        assert workers, "the run ended before its export was seen"
        run.send_signal(signal.SIGTERM)
        run.wait(timeout=30)
        try:
            wait_for(lambda: not any(map(is_running, workers)), 30)
        finally:
            for worker in filter(is_running, workers):
                os.kill(worker, signal.SIGKILL)
    finally:
        run.kill()
        run.wait()
    assert run.returncode == -signal.SIGTERM
    assert not (tmp_path / "out").exists()


def find_workers(place: Path) -> list[int]:
    """The processes for exact solids that got their request in a folder below ``place``."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            line = (folder / "cmdline").read_bytes().decode(errors="replace") if folder.name.isdigit() else ""
        except OSError:  # it has ended
            continue
        if "damageest_cadquery._worker" in line and str(place) in line:
            found.append(int(folder.name))
    return found


def is_running(process: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(what: Any, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)


FAIL = """
import sys
import damageest_cadquery._worker as worker
find = worker.find_exact
def fail(site, *rest):
    return (None, ("forced to fail",)) if site.damage.bounds[0, 0] > 20 else find(site, *rest)
worker.find_exact = fail
worker.start(sys.argv[1:])
"""


@pytest.mark.slow
def test_a_site_without_an_exact_form_costs_only_its_own_solid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two solids, each with a bite; that of the round one gets facets."""
    from damageest_cadquery._assembly import NamedShape, write_assembly
    from damageest_cadquery._faces import list_faces
    from damageest_cadquery._read import read

    import damageest

    block = cq.Workplane().box(20, 12, 8).faces(">Z").workplane().hole(4).val()
    pin = cq.Workplane().circle(6).extrude(8).translate((40, 0, -4)).val()
    shapes = [NamedShape("block", block.wrapped, (9, 9, 9)), NamedShape("pin", pin.wrapped, (9, 9, 9))]
    write_assembly(tmp_path / "two.step", "pair", shapes, "mm")
    damage = [{"tool": "sphere", "centre": [x, 0, 4], "radius": 3} for x in (-10, 46)]
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2, "part": str(tmp_path / "two.step"), "align": "none",
        "scan": {"use": "simulate", "points": 8000, "noise": 0.04, "seed": 4, "damage": damage},
        "export": {"format": ["step"]}, "report": "none",
    }  # fmt: skip
    (tmp_path / "fail.py").write_text(FAIL)
    start = subprocess.Popen

    def start_other(command: list[str], **options: Any) -> Any:
        replaced = [command[0], str(tmp_path / "fail.py"), *command[-2:]] if "_worker" in command[2] else command
        return start(replaced, **options)

    monkeypatch.setattr(subprocess, "Popen", start_other)
    result = damageest.run(job, output=tmp_path / "out")
    forms = {site.id: result.written.exact[site.id].form for site in result.sites} if hasattr(result, "written") else {}
    failed = next(site.id for site in result.sites if site.damage.bounds[0, 0] > 20)
    assert forms.get(failed, "none") == "none"
    listed = list_faces(read(tmp_path / "out/undamaged.step", ".step"), 1.0)
    kinds = [face.kind for face in listed]
    assert kinds.count("cylinder") == 1, "the bore of the block; the pin has facets"
    assert {face.name for face in listed} >= {"facet", "face 0"}
    solids = {name: cq.importers.importStep(str(tmp_path / f"out/{name}.step")).solids().vals() for name in FILES}
    assert {name: len(found) for name, found in solids.items()} == FILES
    assert all(solid.isValid() for found in solids.values() for solid in found)
    volume = {name: sum(solid.Volume() for solid in found) for name, found in solids.items()}
    assert volume["undamaged"] + volume["damage"] == pytest.approx(block.Volume() + pin.Volume(), rel=5e-3)
    assert volume["result"] == pytest.approx(volume["undamaged"] + volume["damage"], rel=1e-3)
    assert len(list_faces(read(tmp_path / "out/damage.step", ".step"), 1.0)) > 20
    said = (tmp_path / "out/result.json").read_text()
    assert f"site-{failed}.step has facets, not the faces of the CAD file: forced to fail" in said
    assert (
        f"undamaged.step has facets on pin, which site {failed} touches; its other solids have the CAD's faces" in said
    )


FILES = {"damage": 2, "undamaged": 2, "result": 4}
"""How many solids each file holds."""
