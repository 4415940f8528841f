"""`damageest schema`: prints the JSON Schemas, for editors and for checks by other programs, and the reasons."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from damageest.cli import _process
from damageest.cli._streams import keep_for_results, say_result


class SchemaName(StrEnum):
    job = "job"
    result = "result"
    reasons = "reasons"
    errors = "errors"


def command(
    which: Annotated[
        SchemaName,
        typer.Argument(
            help="job: schema of the job file; result: schema of result.json; reasons, errors: their codes, as tables."
        ),
    ] = SchemaName.job,
) -> None:
    """Print JSON Schemas, or tables of reasons and errors. The schema of job files has the options of all installed
    plugins."""
    from damageest.error_codes import format_errors
    from damageest.job.schema import job_schema
    from damageest.output.result_json import result_schema
    from damageest.registry import Registry
    from damageest.rules.reference import format_reasons

    with keep_for_results(for_good=_process.is_command):
        registry = Registry.discover()
        if which is SchemaName.reasons:
            say_result(format_reasons(registry.rules, registry.terms).rstrip("\n"))
            return
        if which is SchemaName.errors:
            say_result(format_errors().rstrip("\n"))
            return
        content = job_schema(registry) if which is SchemaName.job else result_schema()
        say_result(json.dumps(content, indent=2))
