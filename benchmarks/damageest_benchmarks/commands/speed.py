"""`damageest evaluate speed`: where the time of a run goes, against one exact distance pass over the scan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from damageest_evaluate.commands.counted import show_table

from damageest_benchmarks.commands._counted import AsJson, Timeout, Write, prepare_places, write_measured


def command(
    kinds: Annotated[str, typer.Option(metavar="A;B", help="Names of cases. Default: all but the dense scan.")] = "",
    points: Annotated[
        str, typer.Option(metavar="N", help="Points of every scan, for example 1e6, instead of the case's.")
    ] = "",
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value.")
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Runs of each case; the median is given.")] = 1,
    timeout: Timeout = 600,
    write: Write = None,
    as_json: AsJson = False,
    whole: Annotated[
        bool,
        typer.Option(help="Run ten common cases and a large one as whole processes, start and page included."),
    ] = False,
    programs: Annotated[
        list[str] | None,
        typer.Option("--program", metavar="PATH", help="With --whole: the damageest to run, each in turn; repeatable."),
    ] = None,
) -> None:
    """Measure processor and wall time of several kinds of runs.

    Each runs in a process of its own, and is compared with one exact distance pass of libigl over the same points in
    the same process. With --whole each is a command as a user starts it, compared with a pass of a million points.
    """
    from damageest_evaluate.rows import run_one

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks.speed import USUAL, make_speed_cases, make_speed_table

    prepare_places(None, write, "whole" if whole else "speed")
    try:
        count = int(float(points or 0))
    except (ValueError, OverflowError):
        raise InputError(f"--points: '{points}' is not a number, for example 1e6") from None
    names = [name.strip() for name in kinds.split(";")] if kinds else list(USUAL)
    if (whole and (points or settings)) or (programs and not whole):
        raise InputError("--points and --set are for the cases without --whole, --program for those with it")
    if whole:
        _measure_whole(names if kinds else [], programs, repeat, timeout, write, as_json)
        return
    rows: list[list[dict[str, Any]]] = []
    for case in make_speed_cases(names, count, settings or (), Registry.discover()):
        runs = [run_one(case, timeout) for _ in range(repeat)]
        typer.echo(f"{case.varied['kind']}: {runs[-1]['error']} {runs[-1]['seconds']:.1f} s", err=True)
        rows.append(runs)
    table = make_speed_table(rows)
    show_table(table, rows, as_json)
    write_measured(table, "speed", write)


def _measure_whole(
    names: list[str], programs: list[str] | None, repeat: int, timeout: float, write: Path | None, as_json: bool
) -> None:
    from dataclasses import asdict

    from damageest_benchmarks.whole import OWN, make_whole_table, measure_whole

    def tell(run: Any) -> None:
        typer.echo(f"{run.kind}: {run.program}: {run.seconds:.1f} s, {run.passes:.1f} passes", err=True)

    runs = measure_whole(names, programs or [OWN], repeat, timeout, tell)
    table = make_whole_table(runs)
    show_table(table, [asdict(run) for run in runs], as_json)
    write_measured(table, "whole", write)
