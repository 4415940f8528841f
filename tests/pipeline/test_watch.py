"""Cancelling what runs in a thread, from another one: no interrupt is lost, and none comes later."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
import time

import pytest

from damageest.errors import CancelledError
from damageest.pipeline.watch import call_with_cancel


def work(seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


def test_what_runs_ends_soon_after_the_signal() -> None:
    cancel = threading.Event()
    threading.Timer(0.05, cancel.set).start()
    began = time.perf_counter()
    with pytest.raises(CancelledError):
        call_with_cancel(cancel, lambda: work(10))
    assert time.perf_counter() - began < 5


def test_a_signal_at_the_very_end_leaves_no_interrupt_behind() -> None:
    threads = threading.active_count()
    for k in range(40):
        cancel = threading.Event()
        timer = threading.Timer(0.005 * (k % 8), cancel.set)
        timer.start()
        try:
            call_with_cancel(cancel, lambda: work(0.02))
        except CancelledError:
            assert cancel.is_set()
        timer.join()
    work(0.1)  # a late interrupt would end the test here
    assert threading.active_count() <= threads


def test_ctrl_c_stays_ctrl_c() -> None:
    def press() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        call_with_cancel(threading.Event(), press)
    assert not isinstance(caught.value, CancelledError)


def test_a_program_that_is_traced_goes_on() -> None:
    """As under coverage and in debuggers, with the signal set and not: Python 3.11 went round for ever."""
    script = textwrap.dedent("""
        import sys, threading, time
        from damageest.errors import CancelledError
        from damageest.pipeline.watch import call_with_cancel
        sys.settrace(lambda frame, event, told: None)
        def add(a, b):
            return a + b
        def work(is_endless):
            time.sleep(0.01)
            while is_endless:
                add(1, 2)
        for is_set in (False, True):
            cancel = threading.Event()
            threading.Timer(0.02, cancel.set).start() if is_set else None
            try:
                call_with_cancel(cancel, lambda: work(is_set))
            except CancelledError:
                print("cancelled")
            print(add(1, 2))
    """)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout.split(), done.stderr) == (["3", "cancelled", "3"], "")
