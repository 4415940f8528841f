"""Batches on Dask: every job is a row, whatever it does; a batch that is stopped goes on where it was."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import damageest
from damageest.batches.files import NEW_ROWS, read_rows
from damageest.batches.rows import Row
from damageest.isolation import end_workers
from tests import damaged_box

pytestmark = pytest.mark.needs("distributed")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Workers that are threads: they start quickly, and each job has a process all the same."""
    from distributed import Client

    with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        yield client


@pytest.fixture(autouse=True)
def _end() -> Iterator[None]:
    yield
    end_workers()


def without_times(folder: Path) -> dict[str, bytes]:
    """The files of an output folder; of result.json without seconds."""
    files = damaged_box.content(folder)
    content = json.loads(files["result.json"])
    for stage in [*content["stages"], *content["steps"]]:
        del stage["seconds"]
    files["result.json"] = json.dumps(content).encode()
    return {name: data for name, data in files.items() if not name.endswith(".npz")}  # they hold the time of day


@dataclass(frozen=True)
class Done:
    """A batch: its job files, its rows, and the folder with its output ``b`` and, as ``first``, what its first job
    wrote."""

    words: list[Path]
    rows: list[Row]
    folder: Path


@pytest.fixture(scope="module")
def done(client: Any, tmp_path_factory: pytest.TempPathFactory) -> Done:
    """A job of a matrix, one that is refused, one whose scan is not there."""
    folder = tmp_path_factory.mktemp("batch")
    job = damaged_box.write_least(folder)
    shutil.copy(folder / "scan.ply", folder / "second.ply")
    matrix = job.read_text().replace("scan: scan.ply\n", "matrix: {scan: [second.ply, gone.ply]}\n")
    (folder / "night.yaml").write_text(matrix)
    (folder / "faulty.yaml").write_text("version: 1\npart: [")
    shutil.copy(job, folder / "job.txt")
    words = [job, folder / "night.yaml", folder / "faulty.yaml"]
    rows = damageest.batch(words, client=client, output=folder / "b")
    shutil.copytree(folder / "b/job", folder / "first")
    return Done(words, rows, folder)


@pytest.mark.slow
def test_rows_of_a_batch(done: Done) -> None:
    rows = done.rows
    assert [row.name for row in rows] == ["job", "night-second", "night-gone", "faulty"]
    assert [row.outcome for row in rows] == ["ok", "ok", "refused", "refused"]
    assert rows[0].verdict == "1 likely"
    assert rows[0].damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    assert "gone.ply" in rows[2].error
    assert {path.name for path in (done.folder / "b").glob("batch.*")} == {"batch.csv", "batch.json", "batch.html"}


@pytest.mark.slow
def test_a_job_of_a_batch_writes_the_same_bytes_as_a_run(done: Done) -> None:
    job = done.folder / "job.yaml"
    job.write_bytes((done.folder / "job.txt").read_bytes())
    damageest.run(job, output=done.folder / "b/alone")
    assert without_times(done.folder / "b/alone") == without_times(done.folder / "first")


@pytest.fixture(scope="module")
def again(done: Done, client: Any) -> tuple[list[Row], list[set[str]]]:
    """The rows of that batch once more, with the first job changed, and the names of those that were told."""
    told: list[set[str]] = []
    (done.folder / "job.yaml").write_text((done.folder / "job.txt").read_text() + "cluster: {neighbours: 9}\n")
    rows = damageest.batch(
        done.words, client=client, output=done.folder / "b", tell=lambda jobs, rows, active: told.append(set(rows))
    )
    return rows, told


def test_a_batch_runs_again_what_has_changed(done: Done, again: tuple[list[Row], list[set[str]]]) -> None:
    rows, told = again
    assert [row.outcome for row in rows] == ["ok", "ok", "refused", "refused"]
    assert rows[0].key != done.rows[0].key
    assert told[-1] == {row.name for row in done.rows}


def test_a_batch_runs_nothing_again_that_has_not_changed(done: Done, again: tuple[list[Row], list[set[str]]]) -> None:
    assert again[0][1] == done.rows[1]


BATCH = """
import sys
from damageest.cli import main

if __name__ == "__main__":
    open(__file__ + ".started", "w").close()
    main()
"""


def start(tmp_path: Path, *words: str) -> subprocess.Popen[str]:
    script = tmp_path / "batch.py"
    script.write_text(BATCH)
    command = [sys.executable, str(script), "batch", str(tmp_path / "night.yaml"), "--out", str(tmp_path / "b"), *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def write_night(tmp_path: Path, count: int) -> None:
    damaged_box.write_small(tmp_path)
    for number in range(count):
        shutil.copy(tmp_path / "scan.ply", tmp_path / f"scan-{number}.ply")
    text = (tmp_path / "job.yaml").read_text()
    (tmp_path / "night.yaml").write_text(text.replace("scan: scan.ply\n", "matrix: {scan: scan-*.ply}\n"))


def wait_for(tmp_path: Path, pattern: str, folder: str = "b") -> None:
    for _ in range(600):
        if list((tmp_path / folder).glob(pattern)):
            return
        time.sleep(0.1)
    pytest.fail(f"no {pattern}")


def find_workers(process_id: int) -> list[int]:
    import psutil

    return [one.pid for one in psutil.Process(process_id).children() if "spawn_main" in " ".join(one.cmdline())]


@pytest.mark.slow
def test_a_worker_that_is_killed(tmp_path: Path) -> None:
    write_night(tmp_path, 4)
    with start(tmp_path, "--workers", "2") as batch:
        wait_for(tmp_path, ".night*.partial")
        os.kill(find_workers(batch.pid)[0], signal.SIGKILL)
        _, err = batch.communicate(timeout=300)
    assert batch.returncode == 0, err
    rows = json.loads((tmp_path / "b/batch.json").read_text())["jobs"]
    assert [row["outcome"] for row in rows] == ["ok"] * 4
    assert sorted(row["tries"] for row in rows) == [1, 1, 1, 2]


@pytest.mark.slow
def test_workers_of_another_scheduler_come_and_go(tmp_path: Path) -> None:
    """One is killed at work, another comes: four jobs of four are done, and each is a row once."""
    write_night(tmp_path, 4)
    dask, address = [sys.executable, "-m", "distributed.cli.dask_scheduler"], tmp_path / "scheduler.json"
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--memory-limit", "0"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    worker = [*work, "--scheduler-file", str(address), "--no-nanny", "--no-dashboard"]
    started = [subprocess.Popen([*dask, "--port", "0", "--scheduler-file", str(address), "--no-dashboard"], **quiet)]
    try:
        wait_for(tmp_path, "scheduler.json", ".")
        started += [subprocess.Popen(worker, **quiet) for _ in range(2)]
        scheduler = json.loads(address.read_text())["address"]
        with start(tmp_path, "--scheduler", scheduler) as batch:
            wait_for(tmp_path, ".night*.partial")
            started[1].kill()
            started.append(subprocess.Popen(worker, **quiet))
            _, err = batch.communicate(timeout=300)
        assert batch.returncode == 0, err
    finally:
        for one in started:
            one.kill()
            one.wait()
    rows = json.loads((tmp_path / "b/batch.json").read_text())["jobs"]
    assert [(row["name"], row["outcome"]) for row in rows] == [(f"night-scan-{k}", "ok") for k in range(4)]


@pytest.mark.slow
def test_a_killed_batch_goes_on(tmp_path: Path) -> None:
    """SIGKILL leaves no time to write the tables: the jobs that were done are done all the same."""
    write_night(tmp_path, 3)
    with start(tmp_path, "--workers", "1") as batch:
        for _ in range(600):
            if len(read_rows(tmp_path / "b")) == 2:
                break
            time.sleep(0.1)
        os.killpg(batch.pid, signal.SIGKILL)
        batch.communicate(timeout=60)
    first = read_rows(tmp_path / "b")
    assert len(first) == 2
    with start(tmp_path, "--workers", "1") as batch:
        _, err = batch.communicate(timeout=300)
    assert batch.returncode == 0, err
    rows = read_rows(tmp_path / "b")
    assert len(rows) == 3
    assert {name: rows[name] for name in first} == first, "they did not run again"
    assert not (tmp_path / "b" / NEW_ROWS).exists()


@pytest.mark.variants(1)
@pytest.mark.parametrize("seconds", [0.2, 0.8, pytest.param(1.6, marks=pytest.mark.slow)])
def test_ctrl_c_while_workers_start_gives_one_line(seconds: float, tmp_path: Path) -> None:
    """Workers of a cluster that got the signal of the terminal too would print tracebacks."""
    write_night(tmp_path, 2)
    with start(tmp_path, "--workers", "2") as batch:
        wait_for(tmp_path, "batch.py.started", ".")  # before, Python itself ends, with a traceback
        time.sleep(seconds)
        os.killpg(batch.pid, signal.SIGINT)
        _, err = batch.communicate(timeout=60)
    assert batch.returncode == 130, err
    assert err.strip().startswith("interrupted; ")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_an_interrupted_batch_goes_on(tmp_path: Path) -> None:
    write_night(tmp_path, 3)
    with start(tmp_path, "--workers", "1") as batch:
        wait_for(tmp_path, "*/result.json")
        wait_for(tmp_path, ".night*.partial")
        os.killpg(batch.pid, signal.SIGINT)
        _, err = batch.communicate(timeout=60)
    assert batch.returncode == 130, err
    assert "interrupted; the jobs that were done are in" in err
    assert "Traceback" not in err
    first = json.loads((tmp_path / "b/batch.json").read_text())["jobs"]
    assert [row["outcome"] for row in first] == ["ok"]
    with start(tmp_path, "--workers", "1") as batch:
        out, err = batch.communicate(timeout=300)
    assert batch.returncode == 0, err
    assert "3 of 3 jobs ran" in out
    rows = json.loads((tmp_path / "b/batch.json").read_text())["jobs"]
    assert rows[0] == first[0]
    assert {path.name for path in (tmp_path / "b").iterdir() if path.is_dir()} == {f"night-scan-{k}" for k in range(3)}


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_of_it(tmp_path: Path) -> None:
    """Its worker processes read the script again, and with it the call."""
    damaged_box.write_small(tmp_path)
    (tmp_path / "night.py").write_text("import damageest\ndamageest.batch(['job.yaml'], workers=1, output='b')\n")
    command = [sys.executable, "night.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1
    last = " ".join(done.stderr.split("InputError: ")[-1].split())
    assert last.startswith(
        f"batch: its worker processes read {tmp_path / 'night.py'} again, which calls it again try: call"
    )
    assert 'below if __name__ == "__main__":' in last
