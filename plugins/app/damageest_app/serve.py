"""Starts the server of the app on this machine alone, and stops it when nobody looks any more."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import webbrowser
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest_app.security import HOST, Guard, make_token

PAGE = Path(__file__).parent / "page"
FIRST = 60.0
"""Seconds in which the first tab may come; a browser that starts on a busy machine takes its time."""


def serve(path: Path, port: int, browser: bool, idle: int) -> None:
    """Serves until the last tab has been closed for ``idle`` seconds, or Ctrl-C. Raises InputError for a folder that
    cannot be read, and where the port is taken."""
    os.environ["WSLINK_READY_MSG"] = ""
    arguments, sys.argv = sys.argv, sys.argv[:1]  # trame reads the arguments of its own program
    try:
        from trame.app import get_server

        from damageest.registry import Registry
        from damageest_app.folder import Folder
        from damageest_app.panels import build
        from damageest_app.session import Session
        from damageest_app.transfers import make_routes

        registry = Registry.discover()
        folder = Folder.open(path, registry)
        _require_free(port)
        server: Any = get_server(f"damageest-{os.getpid()}", client_type="vue3")
        guard = Guard(make_token())
        session = Session(server, folder, registry)
        server.enable_module(
            {"serve": {"damageest": str(PAGE)}, "scripts": ["damageest/app.js"], "styles": ["damageest/app.css"],
             "vue_use": ["damageest_page"]}
        )  # fmt: skip
        build(session)

        def protect(web: Any) -> None:
            web.app.middlewares.append(guard.middleware())
            web.app.add_routes(make_routes(folder, session.find_output, session.note_upload))
            session.runs.hold = web.shutdown_cancel
            session.runs.release = lambda: None if guard.tabs else web.shutdown_schedule()

        def announce(**_: Any) -> None:
            guard.port = server.port
            address = f"http://{HOST}:{server.port}/index.html?token={guard.token}"
            sys.stdout.write(f"damageest app: {folder.path}\n  {address}\n  Ctrl-C stops it\n")
            sys.stdout.flush()
            loop = asyncio.get_running_loop()
            loop.call_later(1, lambda: None if guard.tabs else session.runs.hold())
            loop.call_later(FIRST, session.runs.release)
            if browser and not webbrowser.open(address):
                sys.stdout.write("no browser was found here; open the address\n")

        server.controller.on_server_bind.add(protect)
        server.controller.on_server_ready.add(announce)
        logging.getLogger("aiohttp.access").setLevel(logging.WARNING)
        try:
            server.start(
                port=port, host=HOST, open_browser=False, show_connection_info=False, disable_logging=True,
                timeout=idle, exec_mode="main",
            )  # fmt: skip
        finally:
            session.runs.stop()
    finally:
        sys.argv = arguments


def _require_free(port: int) -> None:
    """Raises InputError where another program listens on the port."""
    import socket

    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise InputError(f"port {port} cannot be used: {error.strerror}; give another one with --port") from None
