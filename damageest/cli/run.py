"""`damageest run`: runs jobs, with progress on stderr and a table of the sites at the end."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from damageest.cli import _process
from damageest.cli._errors import describe_failure, say_error
from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with_each
from damageest.cli._run_table import print_table
from damageest.cli._streams import keep_for_results, say, say_result
from damageest.geometry.threads import use_threads
from damageest.isolation.limits import STAGE_SECONDS, Limits, limit_this_process, parse_memory
from damageest.isolation.shared_notes import at_work, note_job

IMPORT, IMPORT_SECONDS = "import of the pipeline", 120.0
"""The first step of a run, and after how many seconds it is ended. Without byte-code and from a slow disk it takes a
minute."""


def command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Output folder; only with a single job. Default: out/<name>."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value. May be repeated."),
    ] = None,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Compute all stages again.")] = False,
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only, no progress and no table.")] = False,
    memory: Annotated[
        str,
        typer.Option(
            metavar="SIZE", help="Memory that the run may allocate, for example 6GB. Default: the free memory."
        ),
    ] = "",
    stage_timeout: Annotated[
        float, typer.Option(min=0, help="Seconds after which a stage is ended; 0: never.")
    ] = STAGE_SECONDS,
    threads: Annotated[
        int, typer.Option(min=0, metavar="N", help="Threads that the run uses; 0: one for each core.")
    ] = 0,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Run jobs: compute the damage volumes from part and scan."""
    if threads:
        use_threads(threads)
    limits = Limits(parse_memory(memory) if memory else None, stage_timeout)
    given = _Given(output, tuple(settings or ()), not no_cache, limits, as_json, quiet, debug)
    if output is not None and len(jobs) > 1:
        from damageest.errors import Fault, JobError

        raise JobError(
            [Fault("only valid with a single job; with several jobs, each job's own output folder is used")], "--output"
        )
    end_with_each(
        lambda first: _run_clean(jobs[first:], given),
        [str(path) for path in jobs],
        lambda error, source: _report_failure(error, source, as_json, debug),
    )


@dataclass(frozen=True)
class _Given:
    """The options of the command."""

    output: Path | None
    settings: tuple[str, ...]
    cache: bool
    limits: Limits
    as_json: bool
    quiet: bool
    debug: bool


def _run_clean(jobs: list[Path], given: _Given) -> int:
    """As `_run_jobs`; with --json nothing else is written to standard output, by whatever code."""
    with keep_for_results(given.as_json, for_good=_process.is_command):
        return _run_jobs(jobs, given)


def _run_jobs(jobs: list[Path], given: _Given) -> int:
    """Runs jobs one after the other, all in this process. Gives the exit status."""
    from damageest.cli import _interrupt
    from damageest.cli._progress import Progress
    from damageest.error_codes import format_help
    from damageest.errors import DamageestError
    from damageest.io.files import read_json
    from damageest.job import load
    from damageest.registry import Registry

    limit_this_process(given.limits.memory)
    progress = Progress(given.quiet, _process.BEGAN if _process.is_command else None)
    registry = Registry.discover([progress])
    status = 0
    loaded = []
    for path in jobs:  # every job is checked before the first one runs
        try:
            loaded.append(load(path, registry, given.settings))
        except DamageestError as error:
            status = max(status, _report_failure(error, str(path), given.as_json, given.debug))
    if status:
        return status
    for number, job in enumerate(loaded):
        note_job(number)
        output = given.output or job.output
        try:
            with progress.show_job(job.name):
                # after the first line: it takes time, and where memory ran out, OpenBLAS tries for ever
                with progress.show_step(IMPORT), at_work(IMPORT, IMPORT_SECONDS):
                    from damageest.api import run

                result = run(
                    job, output=given.output or True, cache=given.cache, registry=registry, limits=given.limits
                )
        except DamageestError as error:
            status = max(status, _report_failure(error, job.source, given.as_json, given.debug))
            continue
        except KeyboardInterrupt:
            _interrupt.text = progress.describe_kept(output)
            raise
        target = output.resolve()
        if given.as_json:
            say_result(json.dumps(read_json(target / "result.json")))
        elif not given.quiet:
            print_table(result, target)
        if result.sites and not any(site.accepted for site in result.sites):
            status = max(status, 1)
            say(
                f"error: {job.source}: no site is accepted as damage. Read the reasons, and accept sites in the job: "
                "accept: [1], or accept: all\n" + format_help("not_accepted"),
                err=True,
            )
        if result.failures:
            status = max(status, 1)
            for failure in result.failures if given.quiet or given.as_json else ():
                say(f"error: {failure}", err=True)
    return status


def _report_failure(error: Exception, source: str, as_json: bool, debug: bool) -> int:
    import traceback

    status = int(getattr(error, "exit_status", 1))
    if as_json:
        say_json(describe_failure(error, source))
    if debug:
        traceback.print_exception(error)
    say_error(error)
    return status
