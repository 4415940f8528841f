"""A process that ends when the process that started it ends, also in the middle of a native loop."""

from __future__ import annotations

import os
import selectors
import signal

try:
    import fcntl
except ModuleNotFoundError:  # as on Windows, where isolation/portable.py does it
    fcntl = None  # type: ignore[assignment]


def end_with_parent(leash: int) -> None:
    """Lets the kernel kill this process when the other end of the pipe ``leash``, which its parent holds, closes."""
    if fcntl is not None and hasattr(fcntl, "F_SETSIG"):
        fcntl.fcntl(leash, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(leash, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(leash, fcntl.F_SETFL, fcntl.fcntl(leash, fcntl.F_GETFL) | os.O_ASYNC)
    with selectors.PollSelector() as selector:  # not select(): it takes no file numbers above 1023
        selector.register(leash, selectors.EVENT_READ)
        if selector.select(0):  # it closed before
            os._exit(0)
