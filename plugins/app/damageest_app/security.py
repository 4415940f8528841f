"""Who may ask the server for what: this machine alone, with the token of this start, from the server's own page."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING

from damageest.errors import InputError

if TYPE_CHECKING:
    from aiohttp import web

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
"""Names of this machine that a browser may send; any other is one that somebody has pointed at it."""
LARGEST_UPLOAD = 4 * 10**9
"""Bytes of a file that is dropped on the page."""


def make_token() -> str:
    """A token that nobody guesses, new for each start."""
    return secrets.token_urlsafe(24)


class Guard:
    """Checks requests. ``port`` is set when the server knows its own; ``tabs``: how many pages are connected."""

    def __init__(self, token: str) -> None:
        self.token = token
        self.port = 0
        self.tabs = 0

    @property
    def cookie(self) -> str:
        """The name of the cookie; browsers share cookies between the ports of a machine."""
        return f"damageest_{self.port}"

    def find_fault(self, host: str, origin: str | None, given: str | None) -> str:
        """Why a request is refused; empty where it is not.

        ``host`` and ``origin`` are headers, the latter None where the browser sends none; ``given`` is the token of its
        address or cookie.
        """
        if host not in {f"{name}:{self.port}" for name in NAMES}:
            return "this server answers under 127.0.0.1 and localhost only"
        if origin is not None and origin not in {f"http://{name}:{self.port}" for name in NAMES}:
            return "the request comes from another page"
        if given is None or not hmac.compare_digest(given.encode(), self.token.encode()):
            return "the address lacks the token; open the address that `damageest app` printed"
        return ""

    def middleware(self) -> Callable[..., Awaitable[web.StreamResponse]]:
        """The check as a middleware of aiohttp, for pages, files and the web socket alike."""
        from aiohttp import web

        @web.middleware
        async def check(
            request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
        ) -> web.StreamResponse:
            given = request.query.get("token") or request.cookies.get(self.cookie)
            if fault := self.find_fault(request.headers.get("Host", ""), request.headers.get("Origin"), given):
                return web.Response(status=403, text=f"refused: {fault}\n")
            is_tab = request.path == "/ws"
            self.tabs += is_tab
            try:
                response = await handler(request)
            except web.HTTPException as error:
                self._protect(error.headers)
                raise
            finally:
                self.tabs -= is_tab
            if not response.prepared:
                self._protect(response.headers)
                if "token" in request.query:
                    response.set_cookie(self.cookie, self.token, httponly=True, samesite="Strict")
            return response

        return check

    @staticmethod
    def _protect(headers: object) -> None:
        """No other page may frame this one, and the address with its token goes nowhere."""
        wanted = {
            "X-Frame-Options": "DENY",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Content-Security-Policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
            "frame-ancestors 'none'",
        }
        headers.update(wanted)  # type: ignore[attr-defined]


def confine(folder: Path, name: str) -> Path:
    """The path of ``name`` below ``folder``. Raises InputError where it would lie outside, also by a link."""
    root = folder.resolve()
    try:
        path = (root / name).resolve()
    except (OSError, ValueError, RuntimeError):
        raise InputError(f"{name!r} is no name of a file") from None
    if "\x00" in name or (path != root and root not in path.parents):
        raise InputError(f"{name}: lies outside of {folder}; the app reads and writes below its folder only")
    return path
