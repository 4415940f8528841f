"""`damageest validate`: checks jobs without computing anything."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value. May be repeated."),
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Check jobs without computing, and list all errors with line and column."""
    from damageest.errors import JobError
    from damageest.job import load
    from damageest.registry import Registry

    registry = Registry.discover()
    status = 0
    for path in jobs:
        try:
            job = load(path, registry, settings or [])
        except JobError as error:
            status = 2
            for line in error.lines():
                typer.echo(line, err=True)
            continue
        stages = ", ".join(f"{contract.stage} {stage.use}" for contract, stage in job.stages.items())
        typer.echo(f"{path}: valid; method {job.method}: {stages}")
    raise typer.Exit(status)
