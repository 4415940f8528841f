"""`damageest schema`: JSON Schemas for editors and for checks by others."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer


class Which(StrEnum):
    job = "job"
    result = "result"


def command(
    which: Annotated[Which, typer.Argument(help="Schema of the job file or of result.json.")] = Which.job,
) -> None:
    """Print the JSON Schema of the job, for the plugins installed here, or of result.json."""
    from damageest.job.schema import job_schema
    from damageest.registry import Registry
    from damageest.report.result_json import result_schema

    content = job_schema(Registry.discover()) if which is Which.job else result_schema()
    typer.echo(json.dumps(content, indent=2))
