"""The process of the command line, which may watch a fork of itself that does the work."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import NoReturn

import typer

from damageest.cli import _interrupt
from damageest.cli._errors import describe_failure, say_error
from damageest.cli._json import say_json
from damageest.cli._streams import keep_for_results
from damageest.errors import StageError
from damageest.isolation import supervise as watching
from damageest.isolation.supervise import IS_POSSIBLE, end_like_fork, supervise

LATE = "note: done; a thread of a plugin or library still ran, so its process was ended\n"
BEGAN = time.perf_counter() - time.process_time()
"""About when this process began, on the clock of `time.perf_counter`: it has done nothing but work so far."""
is_command = False
"""Whether this process runs the command line alone. In another program, such as one with tests, it must not fork."""


def end_with(work: Callable[[], int], as_json: bool = False) -> NoReturn:
    """As `end_with_each`, for work that is one item. ``as_json``: nothing but its result is written to standard output,
    by whatever code."""

    def work_clean(_: int) -> int:
        with keep_for_results(as_json, for_good=is_command):
            return work()

    def report(error: StageError, _: str) -> int:
        if "--json" in sys.argv:
            say_json(describe_failure(error))
        say_error(error)
        return error.exit_status

    end_with_each(work_clean, [""], report)


def end_with_each(
    work: Callable[[int], int], names: Sequence[str], report: Callable[[StageError, str], int]
) -> NoReturn:
    """Does ``work`` and ends this process with the exit status that it gives.

    Where this process runs the command line alone, the work is done in a fork of it. ``work`` is called with the number
    of the item to begin with. Where the fork crashes, ``report`` gets the error and the name of the item, and gives an
    exit status; the next fork goes on with the item after it.
    """
    if not (is_command and IS_POSSIBLE and threading.active_count() == 1):
        raise typer.Exit(work(0))
    first = status = 0
    while first < len(names):
        start = first
        end = supervise(lambda: work(start))  # noqa: B023  (called at once)
        if end.error is None:
            if end.late:
                sys.stderr.write(LATE)
            if end.status == -signal.SIGINT:  # the fork could not say so itself
                sys.stderr.write(f"\n{_interrupt.text}\n")
                end_like_fork(_interrupt.STATUS)
            end_like_fork(end.status if end.status < 0 else max(status, end.status))
        if sys.stderr.isatty():
            sys.stderr.write("\x1b[?25h")  # a live display hides the cursor
        sys.stderr.write("\n")
        status = max(status, report(end.error, names[start + max(end.job, 0)]))
        first = start + end.job + 1 if end.job >= 0 else len(names)
    end_like_fork(status)


def bound_end(error: BaseException | None) -> None:
    """Ends this process after `END_SECONDS` where it does not end by itself, since a thread that is no daemon goes on.

    ``error``: the exception that ends it. A fork that is watched needs no such end: who watches it has a limit.
    """
    others = [one for one in threading.enumerate() if not one.daemon and one is not threading.main_thread()]
    if watching.is_watched or not others:
        return
    code = error.code if isinstance(error, SystemExit) else int(error is not None)
    status = code if isinstance(code, int) else int(code is not None)

    def end() -> None:
        time.sleep(watching.END_SECONDS)
        sys.stderr.write(LATE)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)

    threading.Thread(target=end, daemon=True).start()
