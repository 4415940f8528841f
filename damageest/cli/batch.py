"""`damageest batch`: many jobs at once, with a live table."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._streams import keep_for_results, say
from damageest.errors import clean_message
from damageest.isolation.limits import STAGE_SECONDS

if TYPE_CHECKING:
    from rich.table import Table

    from damageest.batches.jobs import BatchJob
    from damageest.batches.rows import Row

SHOWN = 12
"""Finished jobs in the live table; the table at the end has all."""


def command(
    jobs: Annotated[
        list[str],
        typer.Argument(metavar="JOB...", help="Job files, folders with job files, globs; a job may have a matrix."),
    ],
    workers: Annotated[
        int, typer.Option(min=0, help="Local processes, each with one job at a time. Default: one a core.")
    ] = 0,
    memory: Annotated[
        str,
        typer.Option(metavar="SIZE", help="Memory that each job may allocate, for example 6GB. Default: its share."),
    ] = "",
    scheduler: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Run on the Dask cluster at this address, for example tcp://host:8786."),
    ] = "",
    out: Annotated[
        Path, typer.Option("--out", help="Folder for <name>/ of each job, batch.csv, batch.json, batch.html.")
    ] = Path("out/batch"),
    timeout: Annotated[float, typer.Option(min=0, help="Seconds after which a job is ended; 0: never.")] = 3600,
    stage_timeout: Annotated[
        float, typer.Option(min=0, help="Seconds after which a stage in a process of its own is ended; 0: never.")
    ] = STAGE_SECONDS,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of each job: stage.option=value or field=value. May be repeated."),
    ] = None,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Compute all jobs and stages again.")] = False,
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no table.")] = False,
) -> None:
    """Run many jobs at once, each in its own process. A failing job does not stop the batch.

    Exit status 0: all jobs ran, whatever their verdicts; 1: some did not. After Ctrl-C, the same command continues.
    """
    from damageest.batches.run import Options, batch
    from damageest.cli import _interrupt
    from damageest.isolation import parse_memory

    options = Options(parse_memory(memory) if memory else None, timeout, stage_timeout, not no_cache)
    _interrupt.text = f"interrupted; the jobs that were done are in {out}, and the same command continues after them"
    with keep_for_results(as_json), _Display(quiet) as display:
        rows = batch(
            jobs,
            workers=workers or None,
            scheduler=scheduler,
            output=out,
            settings=settings or (),
            options=options,
            tell=display.show,
        )
    if as_json:
        say_json({"jobs": [row.to_values() for row in rows], "written": out / "batch.html"})
    elif not quiet:
        _print(rows, out)
    raise typer.Exit(0 if all(row.ran for row in rows) else 1)


class _Display:
    """On a terminal a live table; in a pipe a line for each job that ends."""

    def __init__(self, quiet: bool) -> None:
        from rich.console import Console

        self.console = Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)
        self.told = 0

    def __enter__(self) -> _Display:
        from rich.live import Live

        self.live = Live(console=self.console, refresh_per_second=4, transient=True)
        if self.console.is_terminal:
            self.live.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.live.is_started:
            self.live.stop()

    def show(self, jobs: Sequence[BatchJob], rows: Mapping[str, Row], active: set[str]) -> None:
        if self.live.is_started:
            self.live.update(_make_live_table(jobs, rows, active))
        for name in list(rows)[self.told :]:  # in the order in which they came
            self.told += 1
            if not self.live.is_started and not self.console.quiet:
                count = f"[{self.told}/{len(jobs)}]"
                say(f"{count} {name}: {_describe(rows[name])}", err=True)


def _describe(row: Row) -> str:
    volume = f", {row.damage_volume:.5g} {row.units}³" if row.sites and row.damage_volume is not None else ""
    said = f"{row.verdict}{volume}" if row.ran else f"{row.outcome}: {clean_message(row.error, 200)}"
    return f"{said}, {row.seconds:.1f} s"


def _make_live_table(jobs: Sequence[BatchJob], rows: Mapping[str, Row], active: set[str]) -> Table:
    from rich.table import Table
    from rich.text import Text

    bad = sum(not row.ran for row in rows.values())
    table = Table(box=None, pad_edge=False, show_header=False, title_justify="left", title_style="bold")
    running = sum(job.name in active for job in jobs)
    table.title = f"{len(rows)} of {len(jobs)} done" + (f", {bad} not well" if bad else "") + f", {running} running"
    for name in list(rows)[-SHOWN:]:
        table.add_row(Text(name), Text(_describe(rows[name])[:110], style="" if rows[name].ran else "red"))
    for job in jobs:
        if job.name in active and job.name not in rows:
            table.add_row(Text(job.name), Text("running", style="cyan"))
    return table


def _print(rows: Sequence[Row], out: Path) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from damageest.batches.rows import show_interval

    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 200)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("job", "outcome", "verdict", "volume", "95 %", "s"):
        table.add_column(name, justify="right" if name in ("volume", "95 %", "s") else "left")
    for row in rows:
        volume = f"{row.damage_volume:.5g} {row.units}³" if row.sites and row.damage_volume is not None else ""
        interval = show_interval(row.volume_95) if row.volume_95 and row.sites else ""
        outcome = Text(row.outcome, style="" if row.ran else "red")
        table.add_row(Text(row.name), outcome, Text(row.verdict), volume, interval, f"{row.seconds:.1f}")
    console.print(table)
    for row in rows:
        if not row.ran:
            console.print(Text(clean_message(f"{row.name}: {row.outcome}: {row.error}")))
    console.print(
        Text(clean_message(f"{sum(row.ran for row in rows)} of {len(rows)} jobs ran; written to {out / 'batch.html'}"))
    )
