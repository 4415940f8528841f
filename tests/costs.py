"""A plugin of pytest: the processor seconds of each test, those of its child processes included.

A run ends with the ten dearest of the default tests. With ``--dear-fails`` (CI), those above `MOST` are run again,
alone and without coverage, and the run fails where one is above it a second time. What a fixture takes that several
tests share is not counted: it is not the fault of the test that comes first.

Slow tests above `MOST_SLOW` are nightly: `nightly.txt` lists them, and ``--note-nightly`` writes it anew from what a
run of slow tests took. Those of `KEPT` stay slow whatever they take.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

MOST = 2.0
"""Processor seconds that a default test may take."""
REFERENCE = 0.2
"""Processor seconds of the work of `measure_slowness` on the machine where `MOST` was set."""
MOST_SLOW = 5.0
"""Processor seconds that a slow test may take before it is nightly."""
NIGHTLY = Path(__file__).with_name("nightly.txt")
KEPT = ("tests/test_jobs.py",)
"""Files whose slow tests are never nightly: the example jobs."""
SHOWN = 10
LATER = ("slow", "nightly")
"""Marks of the tests that the default run leaves out."""
COSTS: dict[str, float] = {}
"""Processor seconds by default test, gathered where reports come together."""
SLOW_COSTS: dict[str, float] = {}
"""The same of slow and nightly tests."""
_START = pytest.StashKey[tuple[float, float]]()
_shared = 0.0  # seconds of fixtures that several tests share, so far


def count_processor_seconds() -> float:
    """Seconds of this process and of all below it, those that have ended included."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system + _count_living(os.getpid())


def _count_living(process: int) -> float:
    """Seconds of the living processes below one; 0 where the system does not say which they are."""
    seconds = 0.0
    for threads in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            for child in map(int, threads.read_text().split()):
                told = Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()
                seconds += sum(map(int, told[11:15])) / os.sysconf("SC_CLK_TCK") + _count_living(child)
        except OSError:  # it has just ended
            continue
    return seconds


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--dear-fails", action="store_true", help=f"fail where a default test takes more than {MOST} s twice"
    )
    parser.addoption(
        "--note-nightly", action="store_true", help=f"write {NIGHTLY.name} anew for the slow tests that run"
    )


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Generator[None, Any, Any]:
    global _shared
    if fixturedef.scope == "function":
        return (yield)
    start, before = count_processor_seconds(), _shared
    try:
        return (yield)
    finally:  # what the fixtures that it asks for take is counted already
        _shared += count_processor_seconds() - start - (_shared - before)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    item.stash[_START] = count_processor_seconds(), _shared
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    report = yield
    if call.when == "teardown":
        start, shared = item.stash[_START]
        name = "slow_seconds" if any(item.get_closest_marker(one) for one in LATER) else "processor_seconds"
        report.user_properties.append((name, count_processor_seconds() - start - (_shared - shared)))
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "teardown":
        for name, costs in (("processor_seconds", COSTS), ("slow_seconds", SLOW_COSTS)):
            costs.update((report.nodeid, value) for given, value in report.user_properties if given == name)


def read_nightly() -> set[str]:
    """The names of the slow tests that are nightly since they take long."""
    return set(NIGHTLY.read_text().splitlines()) if NIGHTLY.exists() else set()


def find_dear(costs: dict[str, float]) -> set[str]:
    """The slow tests that are to be nightly."""
    return {name for name, seconds in costs.items() if seconds > MOST_SLOW and not name.startswith(KEPT)}


def note_nightly(costs: dict[str, float]) -> None:
    """Writes the list anew: of tests with known ``costs`` those above `MOST_SLOW`, and the others as they were."""
    names = (read_nightly() - costs.keys()) | find_dear(costs)
    NIGHTLY.write_text("".join(f"{name}\n" for name in sorted(names)))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    dearest = sorted(COSTS.items(), key=lambda one: -one[1])[:SHOWN]
    if len(COSTS) > SHOWN:
        terminalreporter.section(f"the {SHOWN} dearest of {len(COSTS)} default tests, in processor seconds")
        for name, seconds in dearest:
            terminalreporter.write_line(f"{seconds:6.2f}  {name}")
    if dear := sorted(find_dear(SLOW_COSTS) - read_nightly()):
        terminalreporter.section(f"slow tests above {MOST_SLOW} processor seconds that are not nightly")
        for name in dear:
            terminalreporter.write_line(f"{SLOW_COSTS[name]:6.2f}  {name}")
    for name in config.stash.get(_DEAR, ()):
        terminalreporter.write_line(
            f"{name} took more than {MOST} s of processor time twice: make it cheaper, or mark it slow"
        )


_DEAR = pytest.StashKey[tuple[str, ...]]()


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    config = session.config
    if config.getoption("--note-nightly") and not hasattr(config, "workerinput"):
        note_nightly(SLOW_COSTS)
    dear = [name for name, seconds in COSTS.items() if seconds > MOST]
    if exitstatus or not dear or hasattr(config, "workerinput") or not config.getoption("--dear-fails"):
        return
    config.stash[_DEAR] = tuple(find_dear_again(dear, config.rootpath))
    if config.stash[_DEAR]:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def find_dear_again(names: list[str], root: Path) -> list[str]:
    """Runs tests again, each alone, and gives those that are above `MOST` again, as this machine counts seconds.

    Each runs twice in a process of its own, and the second time counts: the first one imports libraries and starts the
    worker that stages share.
    """
    code = (
        "import sys, pytest; from tests import costs\n"
        "for _ in range(2): pytest.main(['-q', '-n', '0', '--no-cov', *sys.argv[1:]], plugins=[])\n"
        "if max(costs.COSTS.values(), default=0) > costs.MOST * costs.measure_slowness(): print('dear')"
    )
    dear = []
    for name in names:
        words = [sys.executable, "-c", code, name]
        done = subprocess.run(words, cwd=root, capture_output=True, text=True, check=False)
        dear += [name] if done.stdout.rstrip().endswith("dear") else []
    return dear


def measure_slowness() -> float:
    """How many times longer than `REFERENCE` this machine takes for the same work now; at least 1."""
    took = []
    for _ in range(5):
        start = time.process_time()
        table = {str(k): k for k in range(200_000)}
        sorted(table, key=lambda key: table[key] * 7919 % 100_003)
        took.append(time.process_time() - start)
    return max(statistics.median(took) / REFERENCE, 1.0)
