"""What a stage is doing now, for those who watch the run: code deep in a stage tells it, the engine passes it on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("damageest_listener", default=None)


@contextmanager
def listen(to: Callable[[str], None]) -> Iterator[None]:
    """Lets ``to`` have what is told in the ``with`` block, in this thread; each text once."""
    last = ""

    def tell(what: str) -> None:
        nonlocal last
        if what != last:
            last = what
            to(what)

    before = _listener.set(tell)
    try:
        yield
    finally:
        _listener.reset(before)


def tell_part(what: str) -> None:
    """Tells which part of a stage's work begins, as "exact STEP: deposit of site 2"; no one need listen."""
    listener = _listener.get()
    if listener is not None:
        listener(what)
