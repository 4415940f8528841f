"""What a caller in Python sees of a run while it goes on, and how it ends one: progress, cancel, what was computed."""

from __future__ import annotations

import ctypes
import threading
import time
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from damageest.errors import CancelledError, DamageestError, clean_message, is_interrupt
from damageest.pipeline.engine import Branch, Engine, Route
from damageest.pipeline.state import JobState
from damageest.pipeline.steps import Step
from damageest.registry.hookspecs import hookimpl
from damageest.result import SoFar

T = TypeVar("T")

POLL = 0.02
"""Seconds between two looks at whether the caller has cancelled."""
AGAIN = 0.5
"""Seconds after which a run that goes on is interrupted again: code of a library may have swallowed it."""


class Signal(Protocol):
    """What cancels a run, as a `threading.Event`."""

    def is_set(self) -> bool: ...


@dataclass(frozen=True)
class Progress:
    """``stage``: what is at work, as "align", with its implementation ``use``, or a step between the stages, without
    one. ``site``: its number, 0 for the whole scan. ``part``: of its work, in words, empty where it tells none.
    ``share``: of the run's stages and steps that are done, 0 to 1; it never falls. ``seconds`` since the run began."""

    stage: str
    use: str
    site: int
    part: str
    share: float
    seconds: float


class Teller:
    """An observer that tells a caller what the stages and steps of one run do. CancelledError of
    the caller ends the run."""

    def __init__(self, to: Callable[[Progress], object], route: Route) -> None:
        self._to, self._names = to, set(list_names(route))
        self._done: set[str] = set()
        self._has_failed = False
        self._began, self._thread = time.monotonic(), threading.get_ident()

    def _tell(self, stage: str, use: str = "", site: int = 0, part: str = "", share: float | None = None) -> None:
        if self._has_failed or threading.get_ident() != self._thread:
            return  # a registry may be used by runs in several threads
        found = len(self._done & self._names) / max(len(self._names), 1)
        seconds = time.monotonic() - self._began
        now = Progress(stage, use, site, part, min(found, 0.99) if share is None else share, seconds)
        try:
            self._to(now)
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            if isinstance(error, CancelledError):
                raise _Stop from error
            self._has_failed = True
            said = f"progress failed at {stage}: {type(error).__name__}: {clean_message(error, 400)}"
            warnings.warn(f"{said}; the run goes on, and it is not called again", RuntimeWarning, stacklevel=2)

    @hookimpl
    def damageest_before_stage(self, stage: str, use: str, site: int) -> None:
        self._tell(stage, use, site)

    @hookimpl
    def damageest_part_begins(self, stage: str, use: str, site: int, what: str) -> None:
        self._tell(stage, use, site, what)

    @hookimpl
    def damageest_after_stage(self, stage: str, use: str, site: int) -> None:
        self._done.add(stage)

    @hookimpl
    def damageest_after_step(self, step: str) -> None:
        self._done.add(step)
        self._tell(step)

    def finish(self) -> None:
        self._tell("done", share=1.0)


def list_names(route: Route) -> Iterator[str]:
    """The names by which observers hear of the stages and steps of a route; of a fork, those of its first way."""
    for item in route:
        if isinstance(item, Branch):
            yield from list_names(item.routes[0] if item.routes else ())
        elif isinstance(item, Step):
            yield item.name.replace("_", " ").strip()
        else:
            yield item.stage


class _Stop(KeyboardInterrupt):
    """What is raised in the thread of a run that is cancelled: all code of damageest treats it as Ctrl-C."""


class _Watcher:
    """Looks at a signal in a thread of its own, and interrupts the thread that made it once the signal is set."""

    def __init__(self, signal: Signal) -> None:
        self._signal, self._target = signal, threading.get_ident()
        self._over = self._sent = self._ended = False
        self._thread = threading.Thread(target=self._watch, name="damageest cancel", daemon=True)

    def start(self) -> None:
        """Begins the watch; what it interrupts has to be ready for it."""
        self._thread.start()

    def _watch(self) -> None:
        later = 0.0
        try:
            while not self._over:
                time.sleep(POLL)
                if self._signal.is_set() and time.monotonic() > later and not self._over:
                    self._sent, later = True, time.monotonic() + AGAIN
                    self._interrupt()
        finally:
            self._ended = True

    def _interrupt(self) -> None:
        """It is raised at the next instruction of Python code there, in place of one that still waits for it."""
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._target), ctypes.py_object(_Stop))

    def end(self) -> None:
        """Ends the watch. No interrupt comes after it.

        An interrupt that still waits to be raised is raised here. To take it back by a null pointer would leave the
        interpreter looking for it at each instruction, for ever, and Python 3.11 never leaves a function that it traces
        then (under coverage, or in a debugger).
        """
        while True:
            try:
                self._over = True
                while not self._ended:
                    time.sleep(POLL / 10)
                if not self._sent:
                    break
                self._sent = False
                self._interrupt()
                time.sleep(POLL)
            except _Stop:
                continue
        self._thread.join()


def call_with_cancel(signal: Signal | None, call: Callable[[], T]) -> T:
    """What ``call`` gives. It ends soon after ``signal`` is set, as by Ctrl-C, so that its processes end and its
    scratch files go. Raises CancelledError then, and where the
    caller raised it when it was told the progress.

    It is no context manager: an interrupt between the block and the end of the watch would come out of it.
    """
    if signal is None:
        try:
            return call()
        except KeyboardInterrupt as error:
            if not _was_raised_by_caller(error):
                raise
            raise _make_cancelled(error) from error
    if signal.is_set():
        raise CancelledError
    watcher = _Watcher(signal)
    try:
        try:
            watcher.start()
            return call()
        finally:
            watcher.end()
    except KeyboardInterrupt as error:
        watcher.end()  # again, where the interrupt came before the first one had begun
        if not signal.is_set() and not _was_raised_by_caller(error):
            raise
        raise _make_cancelled(error) from error


def _was_raised_by_caller(error: BaseException) -> bool:
    """Whether an interrupt is a CancelledError of the caller's, raised from ``progress``."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, CancelledError):
        cause = cause.__cause__
    return cause is not None


def _make_cancelled(error: BaseException) -> CancelledError:
    cancelled = CancelledError()
    cancelled.so_far = getattr(error, "so_far", None)
    return cancelled


@contextmanager
def keep_so_far(engine: Engine) -> Iterator[None]:
    """Gives an error that ends a run what the run had computed before it, as ``so_far``."""
    try:
        yield
    except (DamageestError, KeyboardInterrupt) as error:
        error.so_far = gather_so_far(engine)  # type: ignore[union-attr]
        raise


def gather_so_far(engine: Engine) -> SoFar:
    """The values of the run's last state, and its records of stages."""
    last: JobState = engine.last or JobState()
    values = {name: last.get(name) for name in SoFar.__dataclass_fields__ if name in last.values}
    return SoFar(**{**values, "stages": tuple(engine.records)})


@dataclass
class MemoryCache:
    """What stages gave, in memory, for callers who run jobs on the same part many times: give the same one as ``cache``
    to each run. It keeps the last ``most`` values; a key is made of code, options and inputs, so that none is ever out
    of date. Runs of several threads may share it."""

    most: int = 200
    _kept: OrderedDict[tuple[str, str], Any] = field(default_factory=OrderedDict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def get(self, name: str, key: str) -> tuple[bool, Any]:
        """(found, value)."""
        with self._lock:
            if (name, key) not in self._kept:
                return False, None
            self._kept.move_to_end((name, key))
            return True, self._kept[name, key]

    def put(self, name: str, key: str, value: Any) -> None:
        """Keeps a value."""
        with self._lock:
            self._kept[name, key] = value
            while len(self._kept) > self.most:
                self._kept.popitem(last=False)

    def clear(self) -> None:
        """Forgets all."""
        with self._lock:
            self._kept.clear()
