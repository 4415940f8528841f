"""The caller's side: warm worker processes, one for each owner, and how a failed call is reported."""

from __future__ import annotations

import atexit
import itertools
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from damageest.errors import StageError
from damageest.isolation import serve
from damageest.isolation.failures import ProcessError, RemoteTraceback, blame_authors, describe_end, describe_memory
from damageest.isolation.limits import Limits, format_bytes, measure_free_memory, own_memory
from damageest.isolation.process import Answer, Call, Ended, WorkerProcess
from damageest.isolation.serve import Usage
from damageest.isolation.shared_notes import set_place

T = TypeVar("T")
_workers: dict[tuple[int, str], _Worker] = {}
_workers_lock = threading.Lock()
_numbers = itertools.count()
_cpu_seconds = 0.0


def call_isolated(
    function: Callable[..., T],
    arguments: Mapping[str, Any],
    *,
    worker: str = "",
    owner: str = "",
    limits: Limits | None = None,
    show: bool = True,
    stays: bool = True,
    nested: bool = False,
    processor_time: bool = False,
    tell: Callable[[Usage], None] | None = None,
    watch: Callable[[str], None] | None = None,
) -> T:
    """``function(**arguments)`` in a worker process, which stays for the next call with the same name ``worker``.

    Function, arguments and result have to be picklable, the function by its name in a module that can be imported.
    Arrays go through shared memory; those that the function gets stay read-only where they were. An exception of the
    function is raised here as well, with its traceback as cause. What the function notes with `at_work` has the time
    limit noted with it, and is what the error names.

    ``owner``: whose code it is, as "damageest-open3d 0.1", for messages. ``show``: what the function prints goes to the
    error stream of this process when the call ends. ``stays``: without it the process serves this call alone.
    ``nested``: isolated calls of the function have processes of their own; without it they are ordinary calls.
    ``processor_time``: the time limits of what is noted are ones of processor time, since a busy machine is no reason
    to end it; so is that of ``limits`` then. ``tell`` gets what the call used; where the process was ended or crashed,
    only if its processor time is limited. ``watch`` gets what is noted, and what the
    function tells with `tell_part`, about twice a second.

    Raises StageError, most often ProcessError, where the process crashes or exits, or passes a limit.
    """
    if serve.is_plain:
        return function(**arguments)
    # a forked process has workers of its own
    key = (os.getpid(), worker if stays else f"{worker} {next(_numbers)}")
    with _workers_lock:
        found = _workers.get(key)
        if found is None:
            found = _workers[key] = _Worker()
    call = Call(function, arguments, limits or Limits(), owner, show, nested, processor_time, watch)
    try:
        answer = found.answer(call, tell)
    finally:
        if not stays:
            found.end()
            with _workers_lock:
                _workers.pop(key, None)
    if answer.kind == "value":
        result: T = answer.value
        return result
    error, cause = _unpack(answer, call)
    set_place(error, answer.what)
    raise error from cause


def cpu_seconds() -> float:
    """Processor seconds of this process and of its calls to workers so far."""
    return time.process_time() + _cpu_seconds


def end_workers(beginning: str = "") -> None:
    """Ends the worker processes whose names begin with this, also in the middle of a call; by default all. The next
    call starts a new one."""
    with _workers_lock:
        for (process_id, name), worker in list(_workers.items()):
            if process_id == os.getpid() and name.startswith(beginning) and worker.end():
                del _workers[process_id, name]


atexit.register(end_workers)


class _Worker:
    """A process, started with its first call and after each crash. Calls from several threads wait for each other."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: WorkerProcess | None = None

    def answer(self, call: Call, tell: Callable[[Usage], None] | None) -> Answer:
        """What the process answers. Raises ProcessError where it ends before."""
        global _cpu_seconds
        with self._lock:
            memory = _share_memory(call.limits, call.owner)
            process = self._find_process()
            try:
                answer = process.ask(call, memory)
            except Ended as end:
                status = None if end.seconds else process.wait_for_end()
                what = process.page.read().what
                process.kill()
                if tell and call.processor_time:
                    tell(Usage(end.used, None))
                limits = Limits(call.limits.memory, end.seconds) if end.is_step else call.limits
                error = describe_end(status, process.take_output(), memory, limits, call.owner)
                set_place(error, what)
                raise error  # noqa: B904  (it has a cause)
            except BaseException:  # as Ctrl-C: the worker may be anywhere in the call
                process.kill()
                raise
            if answer.kind in ("exit", "memory"):
                process.kill()  # what it had allocated may still be there
            output = process.take_output()
            if call.show and output:
                sys.stderr.write(output)
        _cpu_seconds += answer.usage.seconds
        if tell:
            tell(answer.usage)
        return answer

    def _find_process(self) -> WorkerProcess:
        """The process, a new one where there is none that runs."""
        if self._process is None or not self._process.is_running:
            if self._process is not None:
                self._process.kill()
            self._process = WorkerProcess()
            self._process.wait_for_start()
        return self._process

    def end(self) -> bool:
        """Ends the process, from any thread. Gives whether no call was in progress; one that was raises then."""
        if self._lock.acquire(blocking=False):
            try:
                if self._process is not None:
                    self._process.kill()
            finally:
                self._lock.release()
            return True
        if self._process is not None:
            self._process.interrupt()
        return False


def _share_memory(limits: Limits, owner: str) -> int:
    """Bytes for the worker: what this process leaves of the limit. Raises StageError where it leaves nothing."""
    if limits.memory is None:
        return measure_free_memory()
    left = limits.memory - own_memory()
    if left < _LEAST_MEMORY:
        raise StageError(
            f"the run holds {format_bytes(own_memory())} of the {format_bytes(limits.memory)} that it may allocate, "
            f"which leaves too little for the process of {owner or 'this stage'}",
            "a larger --memory, a larger tolerance, or fewer scan points",
            code="memory",
        )
    return left


_LEAST_MEMORY = 100 * 10**6
"""A worker needs about this much to start."""


def _unpack(answer: Answer, call: Call) -> tuple[BaseException, BaseException | None]:
    """What the function raised, and its cause."""
    if answer.kind == "exit":
        text = f"called sys.exit({answer.value}), which would end the run"
        return ProcessError("exit", text, blame_authors(call.owner)), None
    if answer.kind == "memory":
        return describe_memory(answer.memory, call.limits), None
    packed, name, text, trace = answer.value
    error = pickle.loads(packed) if packed else type(name, (Exception,), {})(text)
    if not isinstance(error, (Exception, KeyboardInterrupt)):  # as GeneratorExit: it would end more than the call
        error = ProcessError("exit", f"raised {name}{f' ({text})' if text else ''}", blame_authors(call.owner))
    return error, RemoteTraceback(trace)
