"""`damageest init`: a commented starter job, its values read off part and scan."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Annotated

import typer


def command(
    part: Annotated[Path, typer.Argument(help="The part as designed: STL, PLY, OBJ, OFF, 3MF, STEP.")],
    scan: Annotated[Path, typer.Argument(help="The scan of the damaged part.")],
    job: Annotated[Path | None, typer.Option("--job", help="File to write; default: <part>.yaml here.")] = None,
    units: Annotated[str, typer.Option(help="Unit of files that carry none: um, mm, cm, m, in, ft.")] = "mm",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Write a commented starter job with values read off the two files."""
    from damageest.errors import Fault, JobError
    from damageest.job import load
    from damageest.pipeline.prepare import inspect_inputs
    from damageest.registry import Registry

    target = job or Path(f"{part.stem}.yaml")
    if target.exists() and not force:
        raise JobError([Fault("exists already; --force overwrites it, --job names another file")], str(target))
    paths = [os.path.relpath(path.resolve(), target.resolve().parent) for path in (part, scan)]
    source = {"version": 1, "units": units, "part": str(part), "scan": str(scan)}
    registry = Registry.discover()
    solid, cloud, tolerance, doubts = inspect_inputs(load(source, registry), registry)
    lines = [
        f"# {part.name}: {' x '.join(f'{s:.4g}' for s in solid.bounds[1] - solid.bounds[0])} {units}, "
        f"{solid.volume:.5g} {units}3, {len(solid.faces)} triangles",
        f"# {scan.name}: {len(cloud.points)} points, noise {cloud.noise:.3g}, spacing {cloud.spacing:.3g} {units}",
        *(f"# note: {note}" for note in (*solid.notes, *cloud.notes)),
        *(f"# CAUTION: {doubt}" for doubt in doubts),
        "version: 1",
        f"units: {units:<20} # of every length here, and of files that carry none",
        f"tolerance: {tolerance:<16.4g} # lambda: what is closer to the nominal surface is sound; auto: 4 x the noise",
        f"part: {_quoted(paths[0])}",
        f"scan: {_quoted(paths[1])}",
        "align: register             # no initial guess; {use: icp} or none if the scan is in the part's frame already",
        "# method: auto              # surface | implicit",
        "# cluster: {use: dbscan, neighbours: 10}",
        "# allowance: none",
        "# output: out/name",
    ]
    target.write_text("\n".join(lines) + "\n")
    typer.echo(f"wrote {target}; next: damageest run {target}")
    for doubt in doubts:
        typer.echo(f"caution: {doubt}", err=True)


def _quoted(path: str) -> str:
    """The path as a YAML scalar; JSON's quoting is YAML's."""
    return path if re.fullmatch(r"[\w./+-]+", path) else json.dumps(path)
