"""`damageest validate`: checks jobs without computing a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from damageest.cli._process import end_with
from damageest.cli._streams import say


def command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value. May be repeated."),
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Check jobs without computing a result, and list all errors with line and column. Where a job selects faces or
    skin of the part, the part is read."""
    end_with(lambda: _check(jobs, settings or []))


def _check(jobs: list[Path], settings: list[str]) -> int:
    """Prints what is wrong, and gives the exit status."""
    from damageest.errors import InputError, JobError, StageError
    from damageest.job import load
    from damageest.registry import Registry

    registry = Registry.discover()
    status = 0
    for path in jobs:
        try:
            job = load(path, registry, settings)
            if any(stage.find_selectors() for stage in job.stages.values()):  # it is the engine that reads the part
                from damageest.pipeline.selections import check_with_part

                check_with_part(job, registry)
        except JobError as error:
            status = 2
            for line in error.lines():
                say(line, err=True)
            continue
        except (InputError, StageError) as error:
            status = error.exit_status if status < 2 else status
            say(f"{path}: {error}", err=True)
            continue
        stages = ", ".join(f"{contract.stage} {stage.use}" for contract, stage in job.stages.items())
        say(f"{path}: valid; method {job.method}: {stages}")
    return status
