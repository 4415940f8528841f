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

import cadquery_faults
import psutil
import pytest

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


@pytest.mark.slow
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
    try:
        wait_for(lambda: run.poll() is not None or any(tmp_path.glob("damageest-exact-*/*")), 120)
        others = psutil.Process(run.pid).children(recursive=True)
        assert len(others) > 1, "the process that works, and that for exact solids"
        run.send_signal(signal.SIGTERM)
        run.wait(timeout=30)
        _, alive = psutil.wait_procs(others, timeout=30)
        for other in alive:
            other.kill()
        assert not alive
    finally:
        run.kill()
        run.wait()
    assert run.returncode == -signal.SIGTERM
    assert not (tmp_path / "out").exists()


def wait_for(what: Any, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)


@pytest.mark.slow
def test_a_site_without_an_exact_form_costs_only_its_own_solid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two solids, each with a bite; that of the round one gets facets."""
    from damageest_cadquery import exact
    from damageest_cadquery.reading.list_faces import list_faces
    from damageest_cadquery.reading.read import read
    from damageest_cadquery.writing.assembly import NamedShape, write_assembly

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
    monkeypatch.setattr(exact, "make_exact", cadquery_faults.find_none_beyond)
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
