"""The caller's side: warm worker processes, one for each owner, and how a failed call is reported."""

from __future__ import annotations

import atexit
import contextlib
import itertools
import json
import os
import pickle
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from damageest.errors import StageError
from damageest.isolation import serve
from damageest.isolation.clock import TICK, Clock
from damageest.isolation.failures import ProcessError, RemoteTraceback, blame_authors, describe_end, describe_memory
from damageest.isolation.limits import Limits, format_bytes, measure_free_memory, own_memory
from damageest.isolation.notes import Page, set_place
from damageest.isolation.one_thread import ONE_THREAD
from damageest.isolation.serve import Usage
from damageest.isolation.transfer import receive, send

T = TypeVar("T")
START_SECONDS = 120.0
"""Longest time from the start of a worker until it answers."""
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1])\n"
    "from damageest.isolation.serve import main; main(*map(int, sys.argv[2:]))"
)
_MOST_OUTPUT = 1 << 16
"""Bytes of a worker's output that are kept until the call ends."""
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
    to end it. ``tell`` gets what the call used, where it gave a value or raised.

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
    call = _Call(function, arguments, limits or Limits(), owner, show, nested, processor_time)
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


@dataclass(frozen=True)
class _Call:
    """The arguments of `call_isolated`."""

    function: Callable[..., Any]
    arguments: Mapping[str, Any]
    limits: Limits
    owner: str
    show: bool
    nested: bool
    processor_time: bool


@dataclass(frozen=True)
class _Answer:
    """What `serve` sends, and the bytes of ``memory`` that the process could allocate."""

    kind: str
    value: Any
    what: str
    usage: Usage
    memory: int


class _Worker:
    """One process, started with its first call and after each crash. Calls from several threads wait for each other."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._output = bytearray()

    def answer(self, call: _Call, tell: Callable[[Usage], None] | None) -> _Answer:
        """What the process answers. Raises ProcessError where it ends before."""
        global _cpu_seconds
        with self._lock:
            memory = _share_memory(call.limits, call.owner)
            if self._process is None or self._process.poll() is not None:
                self._start()
            assert self._process is not None
            try:
                clock = Clock(self._page, self._process.pid if call.processor_time else None)
                answer = self._exchange(call, memory, clock)
            except _Ended as end:
                status = None if end.seconds else self._wait_for_end()
                what = self._page.read().what
                self.kill()
                limits = Limits(call.limits.memory, end.seconds) if end.is_step else call.limits
                error = describe_end(status, self._take_output(), memory, limits, call.owner)
                set_place(error, what)
                raise error  # noqa: B904  (it has a cause)
            except BaseException:  # as Ctrl-C: the worker may be anywhere in the call
                self.kill()
                raise
            if answer.kind in ("exit", "memory"):
                self.kill()  # what it had allocated may still be there
            output = self._take_output()
            if call.show and output:
                sys.stderr.write(output)
        _cpu_seconds += answer.usage.seconds
        if tell:
            tell(answer.usage)
        return answer

    def _start(self) -> None:
        self._close()
        self._channel, other = socket.socketpair()
        leash, self._leash = os.pipe()
        self._page = Page()
        self._output = bytearray()
        files = (other.fileno(), leash, self._page.file)
        with other:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _CODE, json.dumps(sys.path), *map(str, files)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=files,
                env={**os.environ, **ONE_THREAD},
                start_new_session=True,  # Ctrl-C reaches the caller alone, which then ends the worker
            )
        os.close(leash)
        self._reader = threading.Thread(target=self._collect, args=(self._process, self._output), daemon=True)
        self._reader.start()
        try:
            self._wait(START_SECONDS)
            receive(self._channel, copy=True)
        except (_Ended, EOFError):
            self.kill()
            last = _last_line(self._take_output())
            raise StageError(f"its worker process did not start: {last or 'no message'}", "install it again") from None

    def _exchange(self, call: _Call, memory: int, clock: Clock) -> _Answer:
        try:
            send(self._channel, (sys.path, memory, call.nested))
            send(self._channel, (call.function, dict(call.arguments)))
            self._wait(call.limits.seconds, clock)
            kind, value, what, usage = receive(self._channel, copy=True)
        except (EOFError, ConnectionError):
            raise _Ended from None
        return _Answer(kind, value, what, usage, memory)

    def _wait(self, seconds: float, clock: Clock | None = None) -> None:
        """Waits for an answer. Raises _Ended where there is none in time, or the process has ended."""
        end = time.monotonic() + seconds if seconds else float("inf")
        with selectors.PollSelector() as selector:  # not select(): it takes no file numbers above 1023
            selector.register(self._channel, selectors.EVENT_READ)
            while True:
                left = end - time.monotonic()
                if selector.select(max(0.0, min(left, TICK))):
                    return
                # a process that the worker started may hold the channel open
                if self._process is None or self._process.poll() is not None:
                    raise _Ended
                if left <= 0:
                    raise _Ended(seconds)
                if clock and (late := clock.find_late()):
                    raise _Ended(late.seconds, is_step=True)

    def end(self) -> bool:
        """Ends the process, from any thread. Gives whether no call was in progress; one that was raises then."""
        if self._lock.acquire(blocking=False):
            try:
                self.kill()
            finally:
                self._lock.release()
            return True
        if self._process is not None and self._process.poll() is None:
            with contextlib.suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)
        return False

    def kill(self) -> None:
        """Ends the process and what it started."""
        if self._process is not None:
            with contextlib.suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._reader.join(timeout=1)
        self._close()

    def _wait_for_end(self) -> int | None:
        """The exit status of a process that ends by itself; None where it does not."""
        assert self._process is not None
        try:
            return self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return None

    def _close(self) -> None:
        if hasattr(self, "_channel"):
            self._channel.close()
            os.close(self._leash)
            self._page.close()
            del self._channel, self._leash, self._page

    @staticmethod
    def _collect(process: subprocess.Popen[bytes], output: bytearray) -> None:
        """Reads what the worker prints, so that it never waits for a reader. The end of it is kept."""
        assert process.stdout is not None
        with process.stdout as stream:
            while text := os.read(stream.fileno(), 1 << 16):
                output += text
                del output[:-_MOST_OUTPUT]

    def _take_output(self) -> str:
        text = bytes(self._output).decode(errors="replace")
        self._output.clear()
        return text


class _Ended(Exception):  # noqa: N818
    """The worker gives no answer: it has ended, or is late after ``seconds``, the limit of the call or of a step."""

    def __init__(self, seconds: float = 0.0, is_step: bool = False) -> None:
        self.seconds, self.is_step = seconds, is_step


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
        )
    return left


_LEAST_MEMORY = 100 * 10**6
"""A worker needs about this much to start."""


def _unpack(answer: _Answer, call: _Call) -> tuple[BaseException, BaseException | None]:
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


def _last_line(output: str) -> str:
    lines = output.strip().splitlines()
    return lines[-1][:400] if lines else ""
