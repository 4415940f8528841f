"""`damageest picture`: draws output folders into a PNG file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from damageest.cli._streams import say


def command(
    folders: Annotated[list[Path], typer.Argument(metavar="OUT...", help="Output folders, a column for each.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="PNG file to write.")],
    site: Annotated[
        list[int] | None,
        typer.Option("--site", help="Number of a site to look at. Repeat it for each of several folders; 0: all."),
    ] = None,
    side: Annotated[
        str | None, typer.Option("--from", help="iso, x, y or z. Default: iso; a site from where it is seen best.")
    ] = None,
    show: Annotated[
        list[str] | None,
        typer.Option(
            "--show", help="damage, points, deviation, deposit, stock or path; a row for each. Default: damage."
        ),
    ] = None,
    size: Annotated[str, typer.Option(help="Width and height in pixels, of each column and row.")] = "900x700",
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Draw results off screen, for tickets and papers."""
    import os

    from damageest.errors import Fault, JobError, suggest
    from damageest.io.files import check_output_file
    from damageest.output.folder import open_output
    from damageest.output.pictures import LOOKS, SIDES, Picture, draw_picture

    sides, looks = tuple(SIDES), show or ["damage"]
    for option, given, valid in (("--from", [side] if side else [], sides), ("--show", looks, LOOKS)):
        for word in given:
            if word not in valid:
                text = f"no '{word}'{suggest(word, valid)}; there are: {', '.join(valid)}"
                raise JobError([Fault(text)], option)
    numbers = re.fullmatch(r"(\d+)x(\d+)", size)
    if not numbers or not all(16 <= int(n) <= 8000 for n in numbers.groups()):
        raise JobError(
            [Fault(f"'{size}' is not a size; give width and height, 16 to 8000 each, for example 900x700")], "--size"
        )
    sites = site or [0] * len(folders)
    if len(sites) != len(folders):
        raise JobError([Fault(f"given {len(sites)} times for {len(folders)} folders; give one for each")], "--site")
    if output.suffix.lower() != ".png":
        raise JobError([Fault(f"'{output}' is not a PNG file; name it with .png")], "--output")
    check_output_file(output, "--output")
    opened = tuple(open_output(folder) for folder in folders)
    for folder, number in zip(opened, sites, strict=True):
        folder.check_site(number)
        shown = [number] if number else folder.site_numbers
        if "path" in looks and all(folder.read_path(each) is None for each in shown):
            text = f"{folder.folder} has no path/site-*.csv; plan paths (path: layers) with export.paths: csv"
            raise JobError([Fault(text)], "--show")
    if debug:
        os.environ["DAMAGEEST_DEBUG"] = "1"
    width, height = (int(number) for number in numbers.groups())
    draw_picture(Picture(opened, tuple(sites), tuple(looks), side, (width, height)), output)  # type: ignore[arg-type]
    say(f"written to {output}")
