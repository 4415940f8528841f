"""The worker's side: answers calls until the process that started it ends.

``worker.py`` starts it as ``python -c CODE CHANNEL LEASH PAGE``; all are numbers of open files.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import pickle
import re
import socket
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.isolation import portable, transfer
from damageest.isolation.limits import limited
from damageest.isolation.parent import end_with_parent
from damageest.isolation.shared_notes import Page, find_place, note_on, note_part
from damageest.isolation.telling import listen
from damageest.isolation.transfer import load, receive, receive_parts, send

is_plain = False
"""Whether this process is a worker in which an isolated call is an ordinary call."""


@dataclass(frozen=True)
class Usage:
    """What a call took: processor ``seconds``, and ``megabytes``, the peak of its process; None where the system does
    not tell."""

    seconds: float
    megabytes: float | None


def main(channel_file: int, leash: int, page: int) -> None:
    """Serves until the channel closes. What stages print goes to the error stream, as what libraries print does."""
    end_with_parent(leash)
    _serve(socket.socket(fileno=channel_file), Page(page))


def main_connected(port: int, page: str) -> None:
    """As `main`, for a worker that was given no open files."""
    transfer.SHARES_FILES = False
    channel = portable.connect(port)
    _serve(channel, Page(os.open(page, os.O_RDWR | getattr(os, "O_BINARY", 0))))


def _serve(channel: socket.socket, page: Page) -> None:
    note_on(page)
    os.dup2(2, 1)
    faulthandler.enable()
    try:
        send(channel, "ready")
        while True:
            _answer(channel)
    except (EOFError, ConnectionError):
        os._exit(0)  # without the libraries' own ends, some of which crash


def _answer(channel: socket.socket) -> None:
    """Receives one call and sends (kind, value, what was at work, usage)."""
    global is_plain
    path, memory, nested = receive(channel, copy=True)
    parts = receive_parts(channel, copy=False)
    sys.path[:] = path
    is_plain = not nested
    place, before = "", time.process_time()
    _reset_peak()
    try:
        with limited(memory), listen(note_part):
            function, arguments = load(parts)
            del parts
            answer: tuple[str, Any] = ("value", function(**arguments))
    except SystemExit as error:
        place, answer = find_place(error), ("exit", str(error.code))
    except MemoryError as error:
        place, answer = find_place(error), ("memory", str(error))
    except BaseException as error:
        place, answer = find_place(error), ("error", _pack_error(error))
    sys.stdout.flush()
    sys.stderr.flush()
    usage = Usage(time.process_time() - before, _read_peak())
    try:
        send(channel, (*answer, place, usage))
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        send(channel, ("error", _pack_error(error), place, usage))


def _reset_peak() -> None:
    """Begins a new peak of memory: the process may have answered other calls."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _read_peak() -> float | None:
    """The peak since then in MB; psutil has none, and that of getrusage cannot be reset."""
    try:
        found = re.search(r"^VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    except OSError:
        return None
    return round(int(found[1]) / 1024) if found else None


def _pack_error(error: BaseException) -> tuple[bytes, str, str, str]:
    """(pickle or nothing, name of its class, its text, traceback): not every exception survives pickling."""
    text = "".join(traceback.format_exception(error))
    try:
        packed = pickle.dumps(error)
        if type(pickle.loads(packed)) is not type(error) or str(pickle.loads(packed)) != str(error):
            packed = b""
    except Exception:
        packed = b""
    return packed, type(error).__name__, str(error), text
