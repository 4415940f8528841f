"""The caller's side: warm worker processes, one for each owner, and how a failed call is reported."""

from __future__ import annotations

import atexit
import contextlib
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
from typing import Any, TypeVar

from damageest.errors import StageError
from damageest.isolation import serve
from damageest.isolation.failures import ProcessError, RemoteTraceback, blame_authors, describe_end, describe_memory
from damageest.isolation.limits import Limits, format_bytes, measure_free_memory, own_memory
from damageest.isolation.one_thread import ONE_THREAD
from damageest.isolation.transfer import receive, send

T = TypeVar("T")
START_SECONDS = 120.0
"""Longest time from the start of a worker until it answers."""
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[3])\n"
    "from damageest.isolation.serve import main; main(int(sys.argv[1]), int(sys.argv[2]))"
)
_MOST_OUTPUT = 1 << 16
"""Bytes of a worker's output that are kept until the call ends."""
_workers: dict[tuple[int, str], _Worker] = {}
_workers_lock = threading.Lock()
_cpu_seconds = 0.0


def call_isolated(
    function: Callable[..., T],
    arguments: Mapping[str, Any],
    *,
    worker: str = "",
    owner: str = "",
    limits: Limits | None = None,
    show: bool = True,
) -> T:
    """``function(**arguments)`` in a worker process, which stays for the next call with the same name ``worker``.

    Function, arguments and result have to be picklable, the function by its name in a module that can be imported.
    Arrays go through shared memory; those that the function gets stay read-only where they were. An exception of the
    function is raised here as well, with its traceback as cause. ``owner``: whose code it is, as "damageest-open3d
    0.1", for messages. ``show``: what the function prints goes to the error stream of this process when the call ends.

    Raises StageError, most often ProcessError, where the process crashes or exits, or passes a limit.
    """
    limits = limits or Limits()
    if serve.is_worker:
        return function(**arguments)
    key = (os.getpid(), worker)  # a forked process has workers of its own
    with _workers_lock:
        found = _workers.get(key)
        if found is None:
            found = _workers[key] = _Worker()
    result: T = found.call(function, arguments, limits, owner, show)
    return result


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
    """One process, started with its first call and after each crash. Calls from several threads wait for each other."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._output = bytearray()

    def call(
        self, function: Callable[..., Any], arguments: Mapping[str, Any], limits: Limits, owner: str, show: bool
    ) -> Any:
        with self._lock:
            memory = _share_memory(limits, owner)
            if self._process is None or self._process.poll() is not None:
                self._start()
            try:
                kind, value = self._exchange(function, dict(arguments), memory, limits.seconds)
            except _Ended as end:
                status = None if end.late else self._wait_for_end()
                self.kill()
                raise describe_end(status, self._take_output(), memory, limits, owner)  # noqa: B904  (it has a cause)
            except BaseException:  # as Ctrl-C: the worker may be anywhere in the call
                self.kill()
                raise
            if kind in ("exit", "memory"):
                self.kill()  # what it had allocated may still be there
            output = self._take_output()
            if show and output:
                sys.stderr.write(output)
        return _unpack(kind, value, memory, limits, owner)

    def _start(self) -> None:
        self._close()
        self._channel, other = socket.socketpair()
        leash, self._leash = os.pipe()
        self._output = bytearray()
        with other:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _CODE, str(other.fileno()), str(leash), json.dumps(sys.path)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(other.fileno(), leash),
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

    def _exchange(
        self, function: Callable[..., Any], arguments: dict[str, Any], memory: int | None, seconds: float
    ) -> tuple[str, Any]:
        global _cpu_seconds
        try:
            send(self._channel, (sys.path, memory))
            send(self._channel, (function, arguments))
            self._wait(seconds)
            kind, value, seconds_used = receive(self._channel, copy=True)
        except (EOFError, ConnectionError):
            raise _Ended from None
        _cpu_seconds += seconds_used
        return kind, value

    def _wait(self, seconds: float) -> None:
        """Waits for an answer. Raises _Ended where there is none in time, or the process has ended."""
        end = time.monotonic() + seconds if seconds else float("inf")
        with selectors.PollSelector() as selector:  # not select(): it takes no file numbers above 1023
            selector.register(self._channel, selectors.EVENT_READ)
            while True:
                left = end - time.monotonic()
                if selector.select(max(0.0, min(left, 0.5))):
                    return
                # a process that the worker started may hold the channel open
                if self._process is None or self._process.poll() is not None:
                    raise _Ended
                if left <= 0:
                    raise _Ended(late=True)

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
            del self._channel, self._leash

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
    """The worker gives no answer: it has ended, or it is ``late``."""

    def __init__(self, late: bool = False) -> None:
        self.late = late


def _share_memory(limits: Limits, owner: str) -> int | None:
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


def _unpack(kind: str, value: Any, memory: int | None, limits: Limits, owner: str) -> Any:
    """The value of an answer. Raises what the function raised."""
    if kind == "value":
        return value
    if kind == "exit":
        raise ProcessError("exit", f"called sys.exit({value}), which would end the run", blame_authors(owner))
    if kind == "memory":
        raise describe_memory(memory, limits)
    packed, name, text, trace = value
    error = pickle.loads(packed) if packed else type(name, (Exception,), {})(text)
    if not isinstance(error, (Exception, KeyboardInterrupt)):  # as GeneratorExit: it would end more than the call
        error = ProcessError("exit", f"raised {name}{f' ({text})' if text else ''}", blame_authors(owner))
    raise error from RemoteTraceback(trace)


def _last_line(output: str) -> str:
    lines = output.strip().splitlines()
    return lines[-1][:400] if lines else ""
