"""A process that watches another one, its fork: for code that has no process of its own and may crash, exit or hang.

The fork is made before anything large is imported, so it costs some milliseconds. The terminal, the working directory
and the process group are the same, so that Ctrl-C, Ctrl-Z and pipes work as with one process.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import gc
import io
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from damageest.errors import StageError
from damageest.isolation.clock import TICK, Clock
from damageest.isolation.failures import describe_end
from damageest.isolation.limits import Limits
from damageest.isolation.parent import end_with_parent
from damageest.isolation.shared_notes import Entry, Page, close_entry, note_on

PASSED = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT") if hasattr(signal, name))
"""Signals that are passed on to the fork."""
IS_POSSIBLE = hasattr(os, "fork") and hasattr(signal, "sigtimedwait")  # not on Windows, nor on macOS
END_SECONDS = 10.0
"""Seconds from the end of the work, when all is written, to that of its process. Until then threads that a plugin has
left, and what libraries do at the end, may finish; then the process is ended."""
is_watched = False
"""Whether this process is a fork that another process watches."""
_status: int | None = None
"""The exit status of this fork, once it is known."""
_USER = 0
"""How the system marks a signal of another process; those of a terminal reach the whole group."""


@dataclass(frozen=True)
class End:
    """``status``: the exit status of the fork; ``error``: what ended it where it did not end by itself, in ``job``.
    ``late``: its work was done, but it did not end, and was ended."""

    status: int
    error: StageError | None = None
    job: int = -1
    late: bool = False


def supervise(work: Callable[[], int]) -> End:
    """Runs ``work``, which gives an exit status, in a fork of this process, and gives how the fork ended.

    In the fork this never returns: it raises SystemExit, or what ``work`` raises. The fork is killed where it stays in
    what it notes (`at_work`) for longer than the time limit noted with it, and where this process ends.
    """
    global is_watched
    page = Page(forked=True)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    leash, held = os.pipe()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*PASSED, signal.SIGCHLD})
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        is_watched = True
        os.close(held)
        note_on(page)
        end_with_parent(leash)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        status = 1
        try:
            status = work()
        finally:
            close_entry(status, END_SECONDS)
        sys.exit(status)
    os.close(leash)
    try:
        return _describe(*_wait(child, page), page.read())
    finally:
        os.close(held)
        page.close()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_like_fork(status: int) -> NoReturn:
    """Ends this process in the way its fork ended, without the exit handlers of libraries; ``status`` as of
    subprocess."""
    sys.stdout.flush()
    sys.stderr.flush()
    if status < 0:
        signal.signal(-status, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {-status})
        os.kill(os.getpid(), -status)
    os._exit(status if status >= 0 else 128 - status)


def note_status(status: object) -> None:
    """Notes the exit status that a fork that is watched is about to end with, as of SystemExit. It then ends as soon as
    its threads have ended and exit handlers were called: to take down all objects and modules costs 0.1 s and more."""
    global _status
    if is_watched and (status is None or isinstance(status, int)):
        _status = status or 0


@atexit.register  # before those of libraries, which so are called before it
def _end_now() -> None:
    if _status is None:
        return
    with contextlib.suppress(OSError, ValueError, MemoryError):
        for one in gc.get_objects():  # a file that a plugin has left open
            if type(one) in (io.TextIOWrapper, io.BufferedWriter, io.BufferedRandom) and not one.closed:
                one.flush()
        ctypes.CDLL(None).fflush(None)  # of C libraries
        os._exit(_status)


def _wait(child: int, page: Page) -> tuple[int, bool]:
    """The exit status of the fork, as of subprocess, and whether it was killed since it was late.

    A crash after Ctrl-C counts as an end by it: native code that calls Python may abort where the call is interrupted.
    """
    clock, late, is_interrupted = Clock(page), False, False
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            return -signal.SIGINT if is_interrupted and code < 0 and not late else code, late
        found = signal.sigtimedwait({*PASSED, signal.SIGCHLD}, TICK)
        if found and found.si_signo in PASSED:
            is_interrupted |= found.si_signo == signal.SIGINT
            if found.si_code <= _USER:
                os.kill(child, found.si_signo)
        if clock.find_late() and not late:
            late = True
            os.kill(child, signal.SIGKILL)


def _describe(status: int, late: bool, entry: Entry) -> End:
    """How the fork ended. A crash after its work was done, as of a library that is unloaded, does not count."""
    if not late and -status in PASSED:
        return End(status)
    if not entry.open:
        return End(status if status >= 0 else entry.status, late=late)
    error = describe_end(None if late else status, "", 0, Limits(seconds=entry.seconds), entry.owner)
    if not entry.what:
        error.message = f"the run {error.message}"
    return End(1, _name(error, entry.what), entry.job)


def _name(error: StageError, what: str) -> StageError:
    """The error of the stage that was at work. StageError puts it in front of the message."""
    error.message = f"{what}: {error.message}" if what else error.message
    return error
