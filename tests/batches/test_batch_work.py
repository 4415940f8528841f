"""One job of a batch, in a process of its own: a row, whatever becomes of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from damageest.batches.page import keep_picture, write_page
from damageest.batches.rows import Row, read_row
from damageest.batches.work import run_job, work
from damageest.io.files import embed_png
from damageest.isolation import end_workers
from tests import damaged_box
from tests.registry.test_registry import GROWN, Site, site

__all__ = ["site"]

pytestmark = pytest.mark.needs("distributed")
BODY = "return Solid(damage.vertices * self.factor, damage.faces)"
FAULTY = '''
from damageest.artefacts import Part
from damageest.stages.part import ReadPart

class Faulty(ReadPart):
    """Does what its option says."""
    use: Literal["faulty"] = "faulty"
    fault: str
    def run(self, unit: str) -> Part:
        exec(self.fault)

@hookimpl
def damageest_stages():
    return [Faulty]
'''
FAULTS = {
    "exits": ("import os; os._exit(0)", "ended its process with exit status 0"),
    "crashes": ("import ctypes; ctypes.string_at(0)", "segmentation fault (SIGSEGV)"),
}
HANGING = "part={use: faulty, fault: 'import time; time.sleep(600)'}"


def make_task(job: Path, *settings: str, **limits: Any) -> dict[str, Any]:
    task = {
        "name": "job",
        "job": str(job),
        "settings": list(settings),
        "output": str(job.parent / "b"),
        "batch": "test",
    }
    return {**task, "memory": None, "timeout": 100, "stage_timeout": 60, "cache": True, **limits}


def run_one(job: Path, *settings: str, **limits: Any) -> Row:
    return read_row(work(make_task(job, *settings, **limits)))


@pytest.fixture(autouse=True)
def _end() -> Iterator[None]:
    yield
    end_workers()


def write_page_of(job: Path, *settings: str) -> Path:
    """Runs the job in this process, and writes the page of a batch with it alone; gives the page's folder."""
    folder = job.parent / "out"
    task = make_task(job, *settings) | {"output": str(folder / "job")}
    row = read_row({name: task[name] for name in ("name", "job", "settings", "output")} | run_job(task))
    write_page([row], folder)
    return folder


@pytest.mark.slow
def test_the_page_shows_the_picture_of_the_report(small_done: Path) -> None:
    """It comes from the report as a value, whatever its page looks like."""
    from PIL import Image

    folder = write_page_of(small_done, "report=html")
    assert Image.open(folder / ".job.png").size == (320, 240)
    assert embed_png((folder / ".job.png").read_bytes()) in (folder / "batch.html").read_text()


def test_a_run_without_a_report_has_no_picture(small_done: Path) -> None:
    keep_picture(small_done.parent / "out/job", b"\x89PNG")  # of an earlier run
    assert "data:image" not in (write_page_of(small_done, "report=none") / "batch.html").read_text()


@pytest.mark.slow
def test_a_stage_that_ends_the_process_is_named(site: Site, tmp_path: Path) -> None:
    """The stage has no process of its own: it takes the job's process with it, and the row says which stage it was."""
    site.add("acme-bad", FAULTY)
    body, text = FAULTS["exits"]
    row = run_one(damaged_box.write_least(tmp_path), f"part={{use: faulty, fault: '{body}'}}")
    assert row.outcome == "crashed", row.error
    assert row.error.startswith(f"part: faulty: {text}")


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_stage_of_a_site_that_ends_the_process_is_named(name: str, site: Site, tmp_path: Path) -> None:
    body, text = FAULTS[name]
    site.add("acme-bad", GROWN.replace(BODY, body))
    row = run_one(damaged_box.write_small(tmp_path, "allowance: doubled\n"))
    assert row.outcome == "crashed", row.error
    assert row.error.startswith("allowance: doubled (site 1): ")
    assert text in row.error


@pytest.mark.slow
def test_a_job_that_hangs_is_ended(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", FAULTY)
    job = damaged_box.write_least(tmp_path)
    assert run_one(job, "part=none").outcome == "refused"  # the process has started, and is used again
    row = run_one(job, HANGING, timeout=2)
    assert row.outcome == "timeout", row.error
    assert row.error == "part: faulty: was ended: not finished after 2 s, the time limit of a job"


@pytest.mark.slow
def test_a_stage_of_a_job_that_hangs_is_ended(site: Site, tmp_path: Path) -> None:
    """It has no process of its own."""
    site.add("acme-bad", FAULTY)
    row = run_one(damaged_box.write_least(tmp_path), HANGING, stage_timeout=0.5)
    assert row.outcome == "timeout", row.error
    assert row.error == "part: faulty: was ended: not finished after 0.5 s, the time limit of a stage"
