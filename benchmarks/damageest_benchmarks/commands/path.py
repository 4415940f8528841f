"""`damageest evaluate path`: deposition paths of many deposits, planned with 3 and 5 axes, and checked."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, RowsFile, Write, prepare_places, write_measured


def command(
    jobs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[JOB]...", help="Job files; the losses of their virtual scans count."),
    ] = None,
    each: Annotated[
        int,
        typer.Option(min=0, help="Number of pockets, worn bores, blade tips, broken teeth, and of each tight place."),
    ] = 6,
    random: Annotated[int, typer.Option(min=0, help="Number of random damages of the suite.")] = 20,
    part: Annotated[
        list[Path] | None, typer.Option(help="A part's file, in mm; it gets as many losses as --each says.")
    ] = None,
    out: RowsFile = None,
    write: Write = None,
    as_json: AsJson = False,
) -> None:
    """Plan and check paths for deposits of known shape. Checks fill and collisions of the nozzle.

    Each deposit is planned with 3 and with 5 axes, and both paths are checked. Bead and nozzle fit the deposit; on the
    files of --part the bead is 1.2 mm wide, or less on a small part. The checks share no code with the planner.
    """
    from damageest.registry import Registry
    from damageest_benchmarks.paths.run import describe_row, make_demands, make_table, run_scenes
    from damageest_benchmarks.paths.scenes import make_scenes

    prepare_places(out.parent if out else None, write, "path")
    scenes = make_scenes(jobs or [], each, random, part or [], Registry.discover())
    rows = []
    for row in run_scenes(scenes, out):
        rows.append(row)
        typer.echo(describe_row(row), err=True)
    table = "\n\n".join([make_demands(rows), make_table(rows)])
    show_table(table, list(map(asdict, rows)), as_json)
    write_measured(table, "path", write)
