"""The command `damageest app`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    folder: Annotated[Path, typer.Argument(help="Folder with parts, scans and jobs. Default: this one.")] = Path("."),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the server; 0: a free one.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the browser.")] = True,
    idle: Annotated[
        int, typer.Option(min=0, metavar="SECONDS", help="Stop this long after the last tab was closed; 0: never.")
    ] = 60,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Open, run and judge jobs in the browser of this machine."""
    from damageest_app.serve import serve

    serve(folder, port, browser, idle)
