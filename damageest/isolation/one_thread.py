"""Linear algebra in one thread: the number of threads that share a sum decides its last bits.

The matrices here are small: more threads take a tenth more processor time and no less time on the clock.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Sequence
from typing import Any

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1")
"""The environment of a process of this program: its libraries of linear algebra start no other threads at all."""

_lock = threading.Lock()
_users = 0
_found: list[tuple[Any, int]] = []
"""The libraries, and how many threads each had when the first user came."""


@contextlib.contextmanager
def keep_one_thread() -> Iterator[None]:
    """The linear algebra of numpy and scipy uses one thread, whatever the environment of the process says.

    The number belongs to the process, not to a thread. So of runs at the same time the last one that ends sets it back
    to what the first one found. A library of linear algebra that is loaded later, as a plugin's own, is not included.
    """
    global _users
    with _lock:
        if not _users:
            _found[:] = [(library, library.num_threads) for library in _find_libraries()]
            _set_threads([(library, 1) for library, _ in _found])
        _users += 1
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            if not _users:
                _set_threads(_found)


def _find_libraries() -> list[Any]:
    import scipy.linalg  # noqa: F401  (it loads a library of its own, which can be set only once it is there)
    from threadpoolctl import ThreadpoolController

    return list(ThreadpoolController().select(user_api="blas").lib_controllers)


def _set_threads(libraries: Sequence[tuple[Any, int]]) -> None:
    """Sets the number of threads of each library.

    threadpoolctl lets the first thread that sets the number of OpenBLAS own it, and does nothing, silently, for other
    threads. Here the runs are counted under a lock, so ownership is given up before and after. Older versions know no
    owner.
    """
    from threadpoolctl import OpenBLASController

    give_up = getattr(OpenBLASController, "clear_controlling_thread", lambda force: None)
    give_up(force=True)
    for library, number in libraries:
        library.set_num_threads(number)
    give_up(force=True)
