"""One worker process: started, asked, and ended with all that it started."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.errors import StageError
from damageest.isolation import portable, transfer
from damageest.isolation.clock import TICK, WALL, Clock
from damageest.isolation.interpreter import find_python
from damageest.isolation.limits import Limits
from damageest.isolation.one_thread import ONE_THREAD
from damageest.isolation.serve import Usage
from damageest.isolation.shared_notes import Page
from damageest.isolation.transfer import receive, send

START_SECONDS = 120.0
"""Longest time from the start of a worker until it answers."""
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1])\n"
    "from damageest.isolation.serve import main; main(*map(int, sys.argv[2:]))"
)
_Selector = getattr(selectors, "PollSelector", selectors.SelectSelector)
_MOST_OUTPUT = 1 << 16
"""Bytes of a worker's output that are kept until the call ends."""


@dataclass(frozen=True)
class Call:
    """The arguments of `call_isolated`."""

    function: Callable[..., Any]
    arguments: Mapping[str, Any]
    limits: Limits
    owner: str
    show: bool
    nested: bool
    processor_time: bool
    watch: Callable[[str], None] | None = None


@dataclass(frozen=True)
class Answer:
    """What `serve` sends, and the bytes of ``memory`` that the process could allocate."""

    kind: str
    value: Any
    what: str
    usage: Usage
    memory: int


class Ended(Exception):  # noqa: N818
    """The process gives no answer: it has ended, or is late after ``seconds``, the limit of the call or of a step.
    ``used``: processor seconds, where these are limited."""

    def __init__(self, seconds: float = 0.0, is_step: bool = False) -> None:
        self.seconds, self.is_step, self.used = seconds, is_step, 0.0


class WorkerProcess:
    """A process, which has started when this is made. ``page``: what it notes."""

    def __init__(self) -> None:
        self._output = bytearray()
        self._leash = -1
        self._channel: socket.socket | None = None
        self._named: Path | None = None
        if transfer.SHARES_FILES:
            self._start()
        else:
            self.page, self._named = portable.make_page()
            self._process, self._accept = portable.start(self._named)
        self._reader = threading.Thread(target=self._collect, args=(self._process, self._output), daemon=True)
        self._reader.start()
        self._is_open = True

    def _start(self) -> None:
        """Starts a process that is given the open files that it needs."""
        python = find_python()
        self._channel, other = socket.socketpair()
        leash, self._leash = os.pipe()
        self.page = Page()
        files = (other.fileno(), leash, self.page.file)
        with other:
            self._process = subprocess.Popen(
                [python, "-c", _CODE, json.dumps(sys.path), *map(str, files)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=files,
                env={**os.environ, **ONE_THREAD},
                start_new_session=True,  # Ctrl-C reaches the caller alone, which then ends the worker
            )
        os.close(leash)

    def wait_for_start(self) -> None:
        """Raises StageError where it does not start."""
        try:
            if self._named is not None:
                self._channel = self._accept(START_SECONDS)
            self._wait(START_SECONDS)
            receive(self._open_channel, copy=True)
        except (Ended, EOFError):
            self.kill()
            last = _last_line(self.take_output())
            raise StageError(f"its worker process did not start: {last or 'no message'}", "install it again") from None
        except BaseException:  # as Ctrl-C: the next call would read the answer that is still to come
            self.kill()
            raise

    @property
    def _open_channel(self) -> socket.socket:
        assert self._channel is not None, "wait_for_start comes first"
        return self._channel

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    def ask(self, call: Call, memory: int) -> Answer:
        """What it answers. Raises Ended where it gives no answer."""
        whole = call.limits.seconds if call.processor_time else 0.0
        clock = Clock(self.page, self._process.pid if call.processor_time else None, whole)
        try:
            send(self._open_channel, (sys.path, memory, call.nested))
            send(self._open_channel, (call.function, dict(call.arguments)))
            self._wait(whole * WALL or call.limits.seconds, clock, call.watch)
            kind, value, what, usage = receive(self._open_channel, copy=True)
        except (EOFError, ConnectionError):
            end = Ended()
            end.used = clock.used
            raise end from None
        except Ended as end:
            end.used = clock.used
            raise
        return Answer(kind, value, what, usage, memory)

    def _wait(self, seconds: float, clock: Clock | None = None, watch: Callable[[str], None] | None = None) -> None:
        """Waits for an answer. Raises Ended where there is none in time, or the process has ended."""
        end = time.monotonic() + seconds if seconds else float("inf")
        with _Selector() as selector:  # not select(): it takes no file numbers above 1023
            selector.register(self._open_channel, selectors.EVENT_READ)
            while True:
                left = end - time.monotonic()
                if selector.select(max(0.0, min(left, TICK))):
                    return
                # a process that the worker started may hold the channel open
                if not self.is_running:
                    raise Ended
                if left <= 0:
                    raise Ended(seconds)
                if clock and (late := clock.find_late()):
                    raise Ended(late.seconds, is_step=True)
                if clock and clock.is_exhausted():
                    raise Ended(clock.used)
                if clock and watch:
                    watch(clock.told)

    def interrupt(self) -> None:
        """Kills the process and what it started, from any thread; who waits for it finds that it has ended."""
        if self.is_running:
            self._kill()

    def _kill(self) -> None:
        if not hasattr(os, "killpg"):
            portable.kill_tree(self._process.pid)
            return
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def kill(self) -> None:
        """Ends the process and what it started."""
        self._kill()
        self._process.wait()
        self._reader.join(timeout=1)
        if self._is_open:
            self._is_open = False
            if self._channel is not None:
                self._channel.close()
            if self._leash >= 0:
                os.close(self._leash)
            self.page.close()
            if self._named is not None:
                with contextlib.suppress(OSError):
                    self._named.unlink()
                if self._process.stdin:
                    self._process.stdin.close()

    def wait_for_end(self) -> int | None:
        """The exit status of a process that ends by itself; None where it does not."""
        try:
            return self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return None

    @staticmethod
    def _collect(process: subprocess.Popen[bytes], output: bytearray) -> None:
        """Reads what the worker prints, so that it never waits for a reader. The end of it is kept."""
        assert process.stdout is not None
        with process.stdout as stream:
            while text := os.read(stream.fileno(), 1 << 16):
                output += text
                del output[:-_MOST_OUTPUT]

    def take_output(self) -> str:
        """What it printed since the last call."""
        text = bytes(self._output).decode(errors="replace")
        self._output.clear()
        return text


def _last_line(output: str) -> str:
    lines = output.strip().splitlines()
    return lines[-1][:400] if lines else ""
