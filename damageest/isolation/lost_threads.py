"""Threads of scipy that end with an error of which their caller is not told."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

SEARCH = "_thread_func"
"""Name of the function that threads of scipy's search for neighbours run."""


@contextmanager
def raise_lost() -> Iterator[None]:
    """Raises MemoryError after the block where a thread of scipy's search for neighbours has died in it.

    The search goes on without that thread, and what the thread had to fill in is what the memory held before. Only want
    of memory makes it die. Other threads are not looked at.
    """
    lost: list[str] = []
    before = threading.excepthook

    def note(told: threading.ExceptHookArgs) -> None:
        if told.thread is not None and SEARCH in told.thread.name:
            lost.append(str(told.exc_value))
        else:
            before(told)

    threading.excepthook = note
    try:
        yield
    finally:
        threading.excepthook = before
    if lost:
        raise MemoryError(f"a search for neighbours: {lost[0]}")
