"""What holds where there is no fork, no /proc, no `resource` and no way to hand open files to a process, as on Windows.

The modules and functions are hidden in a process of its own, before damageest is imported, and in those that it starts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests import damaged_box

HIDE = textwrap.dedent("""
    import builtins, io, os, pathlib, selectors, signal, socket, sys
    import subprocess, multiprocessing, tempfile  # what others take on Linux stays theirs
    import filelock, psutil
    psutil.Process().memory_info()
    for name in ("resource", "fcntl", "termios", "grp", "pwd"):
        sys.modules[name] = None
    for name in ("fork", "killpg", "preadv", "pwrite", "memfd_create", "register_at_fork"):
        if hasattr(os, name):
            delattr(os, name)
    for name in ("send_fds", "recv_fds"):
        delattr(socket, name)
    for name in ("SIGHUP", "SIGQUIT", "SIGBUS", "SIGCHLD", "sigtimedwait", "pthread_sigmask"):
        if hasattr(signal, name):
            delattr(signal, name)
    del selectors.PollSelector
    real = io.open
    def refuse(path, *rest, **named):
        frame = sys._getframe(1)
        while "pathlib" in frame.f_code.co_filename:
            frame = frame.f_back
        # psutil and others have ways of their own on each system
        if str(path).startswith("/proc") and f"{os.sep}damageest{os.sep}" in frame.f_code.co_filename:
            raise FileNotFoundError(2, "hidden", str(path))
        return real(path, *rest, **named)
    builtins.open = io.open = refuse
""")


def run(tmp_path: Path, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs Python code in a process that hides all this, as its workers do (sitecustomize)."""
    folder = tmp_path / "hidden"
    folder.mkdir(exist_ok=True)
    (folder / "sitecustomize.py").write_text(HIDE)
    root = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), root])}
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )


FAULTS = """
import sys, time
import numpy as np
from damageest.isolation import Limits, ProcessError, call_isolated
from tests.isolation import faults
large = np.arange(3e5)
assert (call_isolated(faults.add, {"first": large, "second": large}) == 2 * large).all()
for name, why in (("crash", "crash"), ("leave", "exit"), ("loop", "time")):
    try:
        call_isolated(getattr(faults, name), {}, limits=Limits(seconds=0.5))
    except ProcessError as error:
        assert error.why == why, (name, error.why)
        print(name, error)
    else:
        raise AssertionError(name)
assert call_isolated(faults.add, {"first": np.arange(3), "second": np.arange(3)}).tolist() == [0, 2, 4]
print("done")
"""


@pytest.mark.slow
def test_isolated_calls_give_values_and_their_faults_are_errors(tmp_path: Path) -> None:
    done = run(tmp_path, FAULTS)
    assert done.stdout.splitlines()[-1:] == ["done"], done.stdout + done.stderr


COMMAND = "import sys; from damageest.cli import main; sys.argv[0] = 'damageest'; main()"


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess[str]:
    folder = tmp_path_factory.mktemp("portable")
    return run(folder, COMMAND, "run", str(damaged_box.write_least(folder)), "--json", "--memory", "4GB")


def test_a_job_runs(ran: subprocess.CompletedProcess[str]) -> None:
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_its_volume_is_right(ran: subprocess.CompletedProcess[str]) -> None:
    assert json.loads(ran.stdout)["damage_volume"] == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "method: surface\n"], ids=["implicit", "surface"])
def test_a_job_runs_from_python_too(tmp_path: Path, more: str) -> None:
    """`method: surface` has an isolated stage."""
    job = damaged_box.write(tmp_path, damaged_box.JOB + more)
    done = run(tmp_path, COMMAND, "run", str(job), "--json", "--memory", "4GB")
    assert done.returncode == 0, done.stdout + done.stderr
    result = run(tmp_path, f"import damageest; print(damageest.run({str(job)!r}).damage_volume)")
    assert float(result.stdout) == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05), result.stderr
