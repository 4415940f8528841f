"""Calls in a process of their own: values pass unchanged, and whatever happens there is an error here."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Solid
from damageest.errors import InputError, StageError
from damageest.isolation import (
    Limits,
    ProcessError,
    Usage,
    call_isolated,
    end_workers,
    find_place,
    format_bytes,
    measure_free_memory,
    parse_memory,
)
from damageest.isolation.limits import own_memory
from damageest.isolation.transfer import LARGE
from tests import damaged_box
from tests.isolation import faults


@pytest.fixture(scope="module", autouse=True)
def _end() -> Iterator[None]:
    yield
    end_workers()


def call(function: Callable[..., Any], limits: Limits | None = None, **arguments: Any) -> Any:
    return call_isolated(function, arguments, worker="tests", owner="acme 1.2", limits=limits)


def give_back(solid: Solid) -> Solid:
    return solid


def test_arrays_pass_unchanged() -> None:
    first, second = np.arange(12.0).reshape(4, 3), np.asfortranarray(np.ones((4, 3)))
    np.testing.assert_array_equal(call(faults.add, first=first, second=second), first + 1)
    assert call(faults.add, first=np.empty((0, 3)), second=np.empty((0, 3))).shape == (0, 3)


def test_a_large_array_passes_unchanged_and_can_be_edited() -> None:
    """It is mapped, not copied; its map ends with it."""
    large = np.arange(3_000_000.0)
    assert large.nbytes > LARGE
    call(faults.edit, first=np.zeros(3))
    before = len(os.listdir("/proc/self/fd"))
    back = call(faults.add, first=large, second=large[:1])
    np.testing.assert_array_equal(back, large)
    back[:] = 5
    again = call(faults.add, first=back, second=large[1:2])
    assert (back == 5).all()
    assert (again == 6).all()
    del back, again
    assert len(os.listdir("/proc/self/fd")) == before


def test_artefacts_pass_with_their_fields_and_stay_read_only() -> None:
    box = damaged_box.box()
    assert box.volume > 0  # cached: it is no field
    back = call(give_back, solid=box)
    assert type(back) is type(box)
    assert "volume" not in vars(back)
    np.testing.assert_array_equal(back.vertices, box.vertices)
    assert not back.vertices.flags.writeable


def test_what_is_read_only_stays_so() -> None:
    given = np.zeros(3)
    assert call(faults.edit, first=given)[0] == 7
    assert given[0] == 0
    given.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        call(faults.edit, first=given)


def test_the_process_stays_and_is_another() -> None:
    assert call(faults.tell_process) == call(faults.tell_process) != os.getpid()


FAULTS = {
    faults.crash: r"segmentation fault \(SIGSEGV\)",
    faults.abort: r"an abort \(SIGABRT\)",
    faults.end: "ended its process with exit status 0",
    faults.leave: r"called sys.exit\(0\)",
    faults.fill_memory: "needed more memory than the .* GB that were free",
}


@pytest.mark.slow
@pytest.mark.parametrize("function", FAULTS, ids=lambda function: function.__name__)
def test_faults_are_errors(function: Callable[..., Any]) -> None:
    with pytest.raises(StageError, match=FAULTS[function]) as caught:
        call(function)
    assert "acme 1.2" in caught.value.remedy or function is faults.fill_memory
    assert call(faults.tell_process), "the next call has a new process"


def test_what_the_process_printed_is_the_cause() -> None:
    with pytest.raises(StageError) as caught:
        call(faults.abort)
    assert "an instance of 'acme'" in str(caught.value.__cause__)
    assert "in abort" in str(caught.value.__cause__)


def test_a_hang_ends_with_all_it_started() -> None:
    with pytest.raises(StageError, match=r"not finished after 0\.5 s, the time limit of a stage"):
        call(faults.start_and_loop, Limits(seconds=0.5))


def test_memory_limit_is_one_of_the_run() -> None:
    held = own_memory()  # of a process that has run other tests it may be a gigabyte
    with pytest.raises(StageError, match=r"than the [\d.]+ [MG]B that --memory leaves it"):
        call(faults.fill_memory, Limits(memory=held + 2**29))
    with pytest.raises(StageError, match=r"the run holds [\d.]+ [MG]B of the 10 MB"):
        call(faults.tell_process, Limits(memory=10**7))


def test_an_exception_that_cannot_pass_keeps_its_name() -> None:
    with pytest.raises(Exception, match="not known elsewhere") as caught:
        call(faults.raise_odd)
    assert type(caught.value).__name__ == "OddError"
    assert "raise_odd" in str(caught.value.__cause__)


@pytest.mark.parametrize(
    ("function", "what"),
    [(faults.crash_at_work, "cutting"), (faults.fill_memory_at_work, "cutting"), (faults.raise_at_work, "measuring")],
)
def test_the_error_names_what_was_at_work(function: Callable[..., Any], what: str) -> None:
    with pytest.raises((ProcessError, ValueError)) as caught:
        call(function)
    assert find_place(caught.value) == what
    with pytest.raises(ProcessError) as caught:
        call(faults.crash)
    assert find_place(caught.value) == "", "it is forgotten with the call"


def test_what_is_noted_has_a_time_limit_of_its_own() -> None:
    assert call(faults.wait_at_work, seconds=0.4, limit=1.0, steps=3) == 3, "each by itself"
    with pytest.raises(ProcessError, match=r"not finished after 0\.5 s, the time limit of a stage") as caught:
        call(faults.wait_at_work, seconds=60, limit=0.5)
    assert (caught.value.why, find_place(caught.value)) == ("time", "waiting")


@pytest.mark.slow
def test_a_limit_of_processor_time_counts_no_waiting() -> None:
    def measure(function: Callable[..., Any], **arguments: Any) -> Any:
        return call_isolated(function, arguments, worker="tests", processor_time=True)

    assert measure(faults.wait_at_work, seconds=0.8, limit=0.3) == 1
    with pytest.raises(ProcessError) as caught:
        measure(faults.work_at_work, limit=0.3)
    assert find_place(caught.value) == "working"
    with pytest.raises(ProcessError) as caught:  # but what waits for ever is ended too
        measure(faults.wait_at_work, seconds=60, limit=0.05)
    assert find_place(caught.value) == "waiting"


def test_a_limit_of_processor_time_holds_for_a_whole_call_of_many_parts() -> None:
    """Each part begins anew, and has time enough; what the call has used is told, and what it did is seen."""
    used: list[float] = []
    seen: set[str] = set()
    with pytest.raises(ProcessError) as caught:
        call_isolated(
            faults.work_in_parts, {"seconds": 0.2, "limit": 5.0}, worker="tests", processor_time=True,
            limits=Limits(seconds=0.6), tell=lambda usage: used.append(usage.seconds), watch=seen.add,
        )  # fmt: skip
    assert caught.value.why == "time"
    assert 0.6 < used[0] < 2
    assert any(what.startswith("part ") for what in seen)


def test_parts_that_are_told_in_the_process_reach_who_watches() -> None:
    """They are no new work: its time limit goes on."""
    seen: set[str] = set()
    call_isolated(faults.tell_parts, {"seconds": 0.8}, worker="tests", watch=seen.add)
    assert "the deposit: face 3" in seen


@pytest.fixture
def inside_another_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """As in a CAD program with Python in it: ``sys.executable`` opens one more of its windows. Gives their list."""
    program, windows = tmp_path / "AcmeCad", tmp_path / "windows"
    program.write_text(f"#!/bin/sh\necho opened >> {windows}\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    monkeypatch.delenv("DAMAGEEST_PYTHON", raising=False)
    return windows


def test_a_program_that_embeds_python_is_not_started_again(inside_another_program: Path) -> None:
    assert call_isolated(faults.tell_process, {}, worker="embedded", stays=False) != os.getpid()
    assert not inside_another_program.exists()


def test_without_an_interpreter_it_is_said_how_to_name_one(
    inside_another_program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = Path(sys.exec_prefix) / "bin/python3"
    monkeypatch.setattr(sys, "exec_prefix", str(tmp_path))
    monkeypatch.setattr(sys, "base_exec_prefix", str(tmp_path))
    with pytest.raises(StageError, match="AcmeCad is no Python interpreter") as caught:
        call_isolated(faults.tell_process, {}, worker="embedded", stays=False)
    assert "set DAMAGEEST_PYTHON to a Python 3" in caught.value.remedy
    monkeypatch.setenv("DAMAGEEST_PYTHON", str(python))
    assert call_isolated(faults.tell_process, {}, worker="embedded", stays=False) != os.getpid()
    assert not inside_another_program.exists()


def test_a_process_for_one_call_ends_with_it() -> None:
    import psutil

    first, second = (call_isolated(faults.tell_process, {}, worker="tests", stays=False) for _ in range(2))
    assert first != second
    assert not psutil.pid_exists(first)


def test_an_isolated_call_of_a_call_is_an_ordinary_one_unless_it_is_asked_for() -> None:
    own, other = call_isolated(faults.tell_nested_process, {}, worker="tests")
    assert own == other
    own, other = call_isolated(faults.tell_nested_process, {}, worker="tests", nested=True)
    assert own != other


def test_what_a_call_used_is_told() -> None:
    told: list[Usage] = []
    for size in (300 * 2**20, 1):
        call_isolated(faults.use, {"size": size, "seconds": 0.3}, worker="tests", tell=told.append)
    assert all(0.25 < usage.seconds < 3 for usage in told)
    much, little = (usage.megabytes for usage in told)
    assert much is not None
    assert little is not None
    assert 300 < much < 600
    assert little < much - 250, "the peak of the second call, not that of the process"


CROWDED = """
import os, resource
from damageest.isolation import call_isolated
from damageest.isolation.supervise import supervise
from tests.isolation import faults
most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, 4096), most))
held = [os.open(os.devnull, os.O_RDONLY) for _ in range(1100)]
parent = os.getpid()
assert call_isolated(faults.tell_process, {}) != parent
end = supervise(lambda: 7)
print(end.status)
"""


@pytest.mark.skipif(resource.getrlimit(resource.RLIMIT_NOFILE)[1] < 2000, reason="at most 2000 files may be open here")
def test_a_caller_with_more_than_a_thousand_open_files() -> None:
    done = subprocess.run([sys.executable, "-c", CROWDED], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "7\n"), done.stderr


CALLER = """
import os, sys, threading
from damageest.isolation import call_isolated
from tests.isolation import faults
print(call_isolated(faults.tell_process, {}), flush=True)
call_isolated(faults.loop, {})
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_no_process_outlives_its_caller(how: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CALLER],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        # a test run in the background ignores SIGINT, and its processes would inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as caller:
        try:
            assert caller.stdout is not None
            worker = int(caller.stdout.readline())
            caller.send_signal(how)
            caller.wait(timeout=30)
        finally:
            caller.kill()
    for _ in range(200):
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        if is_zombie(worker):
            return
        time.sleep(0.05)
    pytest.fail("the worker still runs")


def is_zombie(process_id: int) -> bool:
    with open(f"/proc/{process_id}/stat") as stream:
        return stream.read().rsplit(")", 1)[1].split()[0] == "Z"


@pytest.mark.parametrize(
    ("text", "size"), [("6GB", 6 * 10**9), ("512 MiB", 2**29), ("2e9", 2 * 10**9), ("1.5g", 1.5e9), ("2T", 2e12)]
)
def test_sizes(text: str, size: float) -> None:
    assert parse_memory(text) == size


@pytest.mark.parametrize("text", ["", "much", "-1GB", "0", "6 GX", "1e99", "5"])
def test_sizes_that_are_none(text: str) -> None:
    with pytest.raises(InputError, match=r"--memory: .* is not valid; give a size"):
        parse_memory(text)


@pytest.mark.slow
def test_free_memory() -> None:
    assert 0 < measure_free_memory() < 2**50
    assert format_bytes(6e9) == "6 GB"
