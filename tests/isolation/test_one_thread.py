"""The same job gives the same bytes from Python and from the command line, whatever number of threads is asked for."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from damageest.isolation import call_isolated, end_workers, keep_one_thread
from tests import damaged_box

FROM_PYTHON = "import sys, damageest; damageest.run(sys.argv[1], output=sys.argv[2])"
AS_COMMAND = (
    "import sys; sys.argv[1:] = ['run', '-q', sys.argv[1], '-o', sys.argv[2]]; import damageest.cli as c; c.main()"
)
ASKED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "IGL_NUM_THREADS")
JOB = damaged_box.JOB.replace("align: none\n", "").replace("tolerance: 0.2", "tolerance: 0.4")


def run_job(program: str, path: Path, threads: str) -> dict[str, bytes]:
    """The files that a process writes in which the libraries are asked for this many threads; empty: for nothing.

    With the kernels of a processor for which one thread and two give other bits in this job, so that the test can fail
    wherever OpenBLAS has them.
    """
    out = path.parent / "out"  # one folder for all: its name is in the result
    environment = {name: value for name, value in os.environ.items() if name not in ASKED}
    environment |= dict.fromkeys(ASKED, threads) if threads else {}
    arguments = [sys.executable, "-c", program, str(path), str(out)]
    subprocess.run(arguments, env=environment | {"OPENBLAS_CORETYPE": "Haswell"}, check=True, timeout=300)
    found = {name: data for name, data in damaged_box.content(out).items() if not name.startswith("stages/")}
    content = json.loads(found["result.json"])
    for stage in [*content["stages"], *content["steps"]]:
        del stage["seconds"]
    found["result.json"] = json.dumps(content).encode()
    shutil.rmtree(out)
    return found


@pytest.mark.slow
def test_python_and_command_give_the_same_bytes_with_one_thread_and_two(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path, JOB, 6000)
    first = run_job(AS_COMMAND, path, "")
    assert json.loads(first["result.json"])["sites"]
    for program, threads in ((AS_COMMAND, "2"), (FROM_PYTHON, ""), (FROM_PYTHON, "1"), (FROM_PYTHON, "2")):
        again = run_job(program, path, threads)
        assert again.keys() == first.keys()
        assert not [name for name in first if first[name] != again[name]], f"{program} with {threads or 'no'} threads"


def count_threads() -> set[int]:
    """How many threads the libraries of linear algebra in this process use."""
    import scipy.linalg  # noqa: F401

    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture
def two_threads() -> Iterator[None]:
    np.zeros(1)
    count_threads()
    with threadpool_limits(limits=2, user_api="blas"):
        yield
    end_workers()


@pytest.mark.usefixtures("two_threads")
def test_the_number_is_one_within_and_as_before_afterwards() -> None:
    before = count_threads()
    with keep_one_thread(), keep_one_thread():
        assert count_threads() == {1}
    assert count_threads() == before
    with pytest.raises(KeyError), keep_one_thread():
        raise KeyError
    assert count_threads() == before


@pytest.mark.usefixtures("two_threads")
def test_of_two_runs_at_the_same_time_the_one_that_ends_first_leaves_one_thread_to_the_other() -> None:
    before, entered, leave = count_threads(), threading.Event(), threading.Event()

    def hold() -> None:
        with keep_one_thread():
            entered.set()
            leave.wait(60)

    other = threading.Thread(target=hold)
    with keep_one_thread():
        other.start()
        assert entered.wait(60)
    assert count_threads() == {1}
    leave.set()
    other.join(60)
    assert count_threads() == before


@pytest.mark.usefixtures("two_threads")
def test_a_run_in_another_thread_has_one_thread_too() -> None:
    """The fixture's limit, in this thread, is still open: threadpoolctl lets no other thread change it."""
    found: list[set[int]] = []

    @keep_one_thread()
    def look() -> None:
        found.append(count_threads())

    other = threading.Thread(target=look)
    other.start()
    other.join(60)
    assert found == [{1}]


def test_a_worker_process_has_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ASKED:
        monkeypatch.setenv(name, "2")
    assert call_isolated(count_threads, {}, worker="threads") == {1}
