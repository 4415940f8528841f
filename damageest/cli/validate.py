"""`damageest validate`: checks jobs without computing a result."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from damageest.cli._errors import say_help
from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with
from damageest.cli._streams import say


def command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value. May be repeated."),
    ] = None,
    as_json: AsJson = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Check jobs and list all errors with line and column. It computes no result, and reads the part only where a job
    selects faces or skin."""
    end_with(lambda: _check(jobs, settings or [], as_json), as_json)


def _check(jobs: list[Path], settings: list[str], as_json: bool) -> int:
    """Prints what is wrong, and gives the exit status."""
    from damageest.errors import DamageestError, Fault, InputError, JobError, StageError
    from damageest.job import load
    from damageest.pipeline.workspace import check_target
    from damageest.registry import Registry

    registry = Registry.discover()
    status = 0
    rows: list[dict[str, Any]] = []
    last: DamageestError | None = None
    for path in jobs:
        try:
            job = load(path, registry, settings)
            check_target(job.output)
            if any(stage.find_selectors() for stage in job.stages.values()):  # it is the engine that reads the part
                from damageest.pipeline.placing.selections import check_with_part

                check_with_part(job, registry)
        except JobError as error:
            status, last = 2, error
            rows.append({"job": path, "is_valid": False, "faults": [asdict(fault) for fault in error.faults]})
            for line in error.lines():
                say(line, err=True)
            continue
        except (InputError, StageError) as error:
            status, last = error.exit_status if status < 2 else status, error
            rows.append({"job": path, "is_valid": False, "faults": [asdict(Fault(str(error)))]})
            say(f"{path}: {error}", err=True)
            continue
        chosen = [{"stage": contract.stage, "use": stage.use} for contract, stage in job.stages.items()]
        rows.append({"job": path, "is_valid": True, "faults": [], "method": job.method, "stages": chosen})
        named = ", ".join(f"{one['stage']} {one['use']}" for one in chosen)
        say(f"{path}: valid; method {job.method}: {named}")
    if as_json:
        say_json({"jobs": rows})
    if last is not None:
        say_help(last)
    return status
