"""How a worker is started where a process cannot be given open files, as on Windows: by a connection of this machine.

The caller listens on the loopback address. The worker gets the port as an argument and a secret through its standard
input, connects, and sends the secret first. Standard input stays open as long as the caller lives.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import os
import secrets
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from damageest.isolation.clock import TICK
from damageest.isolation.interpreter import find_python
from damageest.isolation.one_thread import ONE_THREAD
from damageest.isolation.shared_notes import Entry, Page
from damageest.isolation.transfer import receive_bytes

CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1])\n"
    "from damageest.isolation.serve import main_connected; main_connected(int(sys.argv[2]), sys.argv[3])"
)
_SIZE = 64
"""Bytes of the secret."""


def make_page() -> tuple[Page, Path]:
    """A page in a file that another process can open by its name, and the file."""
    file, name = tempfile.mkstemp(prefix="damageest-")
    os.write(file, bytes(4096))
    page = Page(file)
    page.write(Entry())
    return page, Path(name)


def start(page: Path) -> tuple[subprocess.Popen[bytes], Callable[[float], socket.socket]]:
    """The worker's process, and a function that waits some seconds for its connection. That raises EOFError where the
    process ends before, or is late."""
    python, secret = find_python(), secrets.token_hex(_SIZE // 2).encode()
    listener = socket.create_server(("127.0.0.1", 0))
    process = subprocess.Popen(
        [python, "-c", CODE, json.dumps(sys.path), str(listener.getsockname()[1]), str(page)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, **ONE_THREAD},
        start_new_session=os.name == "posix",
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    assert process.stdin is not None
    with contextlib.suppress(OSError):
        process.stdin.write(secret + b"\n")
        process.stdin.flush()

    def accept(seconds: float) -> socket.socket:
        end = time.monotonic() + seconds
        with listener:
            listener.settimeout(TICK)
            while process.poll() is None and time.monotonic() < end:
                with contextlib.suppress(TimeoutError, EOFError):
                    channel, _ = listener.accept()
                    if _knows(channel, secret):
                        return channel
                    channel.close()
        raise EOFError

    return process, accept


def _knows(channel: socket.socket, secret: bytes) -> bool:
    """Whether what is sent first, within a tick, is the secret. Any process of this machine may connect."""
    channel.settimeout(TICK)
    with contextlib.suppress(TimeoutError, EOFError):
        if hmac.compare_digest(bytes(receive_bytes(channel, _SIZE)), secret):
            channel.settimeout(None)
            return True
    return False


def connect(port: int) -> socket.socket:
    """The worker's end of the connection. Ends this process when the caller's end of standard input closes."""
    secret = sys.stdin.buffer.readline().strip()

    def wait() -> None:
        with contextlib.suppress(OSError, ValueError):
            os.read(0, 1)
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()
    channel = socket.create_connection(("127.0.0.1", port))
    channel.sendall(secret)
    return channel


def kill_tree(number: int) -> None:
    """Kills a process and what it started."""
    import psutil

    with contextlib.suppress(psutil.Error):
        process = psutil.Process(number)
        for one in [process, *process.children(recursive=True)]:
            with contextlib.suppress(psutil.Error):
                one.kill()
