"""The worker's side: answers calls until the process that started it ends.

``worker.py`` starts it as ``python -c CODE CHANNEL LEASH``; both are numbers of open files.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import socket
import sys
import time
import traceback
from typing import Any

from damageest.isolation.limits import limited
from damageest.isolation.parent import end_with_parent
from damageest.isolation.transfer import load, receive, receive_parts, send

is_worker = False
"""Whether this process is a worker. An isolated call within one is an ordinary call."""


def main(channel_file: int, leash: int) -> None:
    """Serves until the channel closes. What stages print goes to the error stream, as what libraries print does."""
    global is_worker
    is_worker = True
    end_with_parent(leash)
    os.dup2(2, 1)
    faulthandler.enable()
    channel = socket.socket(fileno=channel_file)
    try:
        send(channel, "ready")
        while True:
            _answer(channel)
    except (EOFError, ConnectionError):
        os._exit(0)  # without the libraries' own ends, some of which crash


def _answer(channel: socket.socket) -> None:
    """Receives one call and sends (kind, value, processor seconds)."""
    path, memory = receive(channel, copy=True)
    parts = receive_parts(channel, copy=False)
    sys.path[:] = path
    before = time.process_time()
    try:
        with limited(memory):
            function, arguments = load(parts)
            del parts
            answer: tuple[str, Any] = ("value", function(**arguments))
    except SystemExit as error:
        answer = ("exit", str(error.code))
    except MemoryError as error:
        answer = ("memory", str(error))
    except BaseException as error:
        answer = ("error", _pack_error(error))
    sys.stdout.flush()
    sys.stderr.flush()
    try:
        send(channel, (*answer, time.process_time() - before))
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        send(channel, ("error", _pack_error(error), time.process_time() - before))


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
