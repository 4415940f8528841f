"""A proxy on the loopback address that passes everything on, and counts the bytes that come back through it."""

from __future__ import annotations

import contextlib
import select
import socket
import socketserver
from collections import Counter
from urllib.parse import urlsplit

PIECE = 1 << 16


class _Handler(socketserver.BaseRequestHandler):
    """One connection: CONNECT to a host, or a plain request by its whole address."""

    server: CountingProxy
    host = ""

    def handle(self) -> None:
        head = b""
        while b"\r\n\r\n" not in head and (piece := self.request.recv(PIECE)):
            head += piece
        if not head:
            return
        first, rest = head.split(b"\r\n", 1)
        method, address, version = first.decode("latin-1").split(" ", 2)
        if method == "CONNECT":
            self.host, port = address.rsplit(":", 1)
            other = socket.create_connection((self.host, int(port)), timeout=60)
            self.request.sendall(b"HTTP/1.1 200 Connection established\r\n\r\n")
        else:
            parts = urlsplit(address)
            self.host = parts.hostname or ""
            other = socket.create_connection((self.host, parts.port or 80), timeout=60)
            path = address.split(parts.netloc, 1)[1] or "/"
            lines = [line for line in rest.split(b"\r\n") if not line.lower().startswith((b"proxy-", b"connection:"))]
            # one request a connection, since the next one may be for another host
            other.sendall(f"{method} {path} {version}\r\nConnection: close\r\n".encode() + b"\r\n".join(lines))
        with contextlib.suppress(OSError), other:
            self._pass_on(other)

    def _pass_on(self, other: socket.socket) -> None:
        while True:
            ready = select.select([self.request, other], [], [], 120)[0]
            if not ready:
                return
            for one in ready:
                data = one.recv(PIECE)
                if not data:
                    return
                (self.request if one is other else other).sendall(data)
                if one is other:
                    self.server.counts[self.host] += len(data)


class CountingProxy(socketserver.ThreadingTCPServer):
    """``counts``: bytes that came back so far, by host. Its address is ``http://127.0.0.1:<port>``."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.counts: Counter[str] = Counter()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def handle_error(self, request: object, client_address: object) -> None:
        """Says nothing: who asked sees that the connection ended."""
