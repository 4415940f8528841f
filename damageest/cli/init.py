"""`damageest init`: writes a commented job file with values measured from part and scan."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Annotated

import typer


def command(
    part: Annotated[Path, typer.Argument(help="CAD file of the part: STL, PLY, OBJ, OFF, 3MF, STEP.")],
    scan: Annotated[Path, typer.Argument(help="The scan of the damaged part.")],
    job: Annotated[
        Path | None, typer.Option("--job", help="Job file to write. Default: <part>.yaml in this folder.")
    ] = None,
    units: Annotated[str, typer.Option(help="Unit of files without a unit: um, mm, cm, m, in, ft.")] = "mm",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Write a commented job file with values measured from part and scan."""
    from damageest.errors import Fault, JobError
    from damageest.job import load
    from damageest.pipeline.prepare import inspect_inputs
    from damageest.registry import Registry

    target = job or Path(f"{part.stem}.yaml")
    if target.exists() and not force:
        raise JobError(
            [Fault("the file exists already; overwrite it with --force, or name another file with --job")], str(target)
        )
    paths = [os.path.relpath(path.resolve(), target.resolve().parent) for path in (part, scan)]
    source = {"version": 1, "units": units, "part": str(part), "scan": str(scan)}
    registry = Registry.discover()
    solid, cloud, tolerance, cautions = inspect_inputs(load(source, registry), registry)
    lines = [
        f"# {part.name}: {' x '.join(f'{s:.4g}' for s in solid.bounds[1] - solid.bounds[0])} {units}, "
        f"{solid.volume:.5g} {units}3, {len(solid.faces)} triangles",
        f"# {scan.name}: {len(cloud.points)} points, noise {cloud.noise:.3g}, spacing {cloud.spacing:.3g} {units}",
        *(f"# note: {note}" for note in (*solid.notes, *cloud.notes)),
        *(f"# CAUTION: {caution}" for caution in cautions),
        "version: 1",
        f"units: {units:<20} # of all lengths in this file, and of files without a unit",
        f"tolerance: {tolerance:<16.4g} # lambda: points closer to the nominal surface are intact; or auto",
        f"part: {_quote(paths[0])}",
        f"scan: {_quote(paths[1])}",
        "align: register             # for any start pose; icp or none if the scan is already in the part's frame",
        "# method: auto              # surface | implicit",
        "# cluster: {use: dbscan, neighbours: 10}",
        "# allowance: none",
        "# output: out/name",
    ]
    target.write_text("\n".join(lines) + "\n")
    typer.echo(f"written to {target}; next: damageest run {target}")
    for caution in cautions:
        typer.echo(f"caution: {caution}", err=True)


def _quote(path: str) -> str:
    """The path as a YAML scalar. A JSON string is valid YAML."""
    return path if re.fullmatch(r"[\w./+-]+", path) else json.dumps(path)
