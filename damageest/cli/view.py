"""`damageest view`: opens the report of an output folder in the browser, or its layers in a window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from damageest.cli._streams import say


def command(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a run.")],
    site: Annotated[int, typer.Option("--site", help="Number of a site to look at.")] = 0,
    window: Annotated[
        bool, typer.Option("--window", help="Open a window of its own instead of the browser; it needs a display.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Open the report of an output folder in the browser."""
    import webbrowser

    from damageest.errors import InputError
    from damageest.output.folder import open_output

    output = open_output(folder)
    output.check_site(site)
    if window:
        from damageest.output.pictures import open_window

        open_window(output, site)
        return
    path = folder.resolve() / "report.html"
    if not path.is_file():
        raise InputError(
            f"{folder}: there is no report.html; run the job again without  report: none, or take --window"
        )
    address = path.as_uri() + (f"#site-{site}" if site else "")
    if webbrowser.open(address):
        say(f"opened {address}")
    else:
        say(f"no browser was found here; open {address}")
