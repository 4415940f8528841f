"""The benchmarks as commands: added to those of `damageest evaluate`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from damageest_evaluate.commands.counted import AsJson, format_command, run_counted, show_table
from damageest_evaluate.commands.job import (
    Against,
    Jobs,
    Noise,
    Out,
    Plots,
    Points,
    Scheduler,
    Settings,
    Timeout,
    Vary,
    app,
    write_report,
)

from damageest_benchmarks.commands import (
    adapt,
    budget,
    difference,
    family,
    honesty,
    inspections,
    named,
    others,
    path,
    prepare,
    real,
    realistic,
    sections,
    speed,
    steady,
    worn,
)
from damageest_benchmarks.commands._counted import Write, prepare_places
from damageest_benchmarks.commands.intervals import show_intervals

if TYPE_CHECKING:
    from damageest_benchmarks.matrix import MatrixCell

for module in (
    adapt, budget, difference, family, honesty, inspections, named, others, real, realistic, steady, sections, speed,
    worn, path, prepare,
):  # fmt: skip
    app.command(module.__name__.rpartition(".")[2])(module.command)
app.command("reported")(others.reported)


@app.command("suite")
def suite_command(
    cases: Annotated[int, typer.Option(help="Number of random damages, on the parts in turn.")] = 26,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the damages, scans and poses.")] = 0,
    parts: Annotated[str, typer.Option(metavar="A,B", help="Names of built-in parts. Default: all.")] = "",
    method: Annotated[str, typer.Option(help="Method of the job: auto, implicit, surface or octree.")] = "auto",
    pose: Annotated[str, typer.Option(help="Pose of the part in the scan: random, or identity (known).")] = "random",
    vary: Vary = None,
    against: Against = None,
    size: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="Depths of the damage in mm, or 4x for 4 tolerances. 0: none; any: all kinds and sizes.",
        ),
    ] = "any",
    noise: Noise = "",
    points: Points = "",
    tolerance: Annotated[
        str, typer.Option(metavar="A,B", help="Multiples of the noise, lengths such as 1mm, or auto.")
    ] = "4",
    settings: Settings = None,
    intervals: Annotated[
        bool,
        typer.Option(
            "--intervals",
            help="Count how often the truth lies in the 95 % intervals, at three noises and three densities.",
        ),
    ] = False,
    jobs: Jobs = 2,
    timeout: Timeout = 300,
    scheduler: Scheduler = "",
    out: Out = None,
    plots: Plots = True,
    as_json: AsJson = False,
    write: Write = None,
    marks: Annotated[
        str, typer.Option(help="Name in the marks <!-- NAME: begin --> and <!-- NAME: end --> of --write.")
    ] = "suite",
) -> None:
    """Measure accuracy on random damages of built-in parts. Thirteen parts, from scan to damage volume."""
    from damageest_evaluate.figures import collect_axes, summarise
    from damageest_evaluate.report import format_row, make_readme_tables
    from damageest_evaluate.variants import VariationRequest

    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_benchmarks import suite
    from damageest_benchmarks.intervals import format_interval_row, make_interval_cases
    from damageest_benchmarks.parts import PARTS
    from damageest_benchmarks.readme import replace_between_marks

    chosen = [name.strip() for name in parts.split(",")] if parts else list(PARTS)
    if intervals:
        if vary or against or settings or noise or points:
            raise InputError(
                "--intervals: varies noise and density itself; leave out --vary, --against, --set, --noise and --points"
            )
        prepare_places(out, write, marks)
        measured = make_interval_cases(cases, seed, chosen, Registry.discover())
        rows = run_counted(measured, out, "intervals.jsonl", jobs, timeout, format_interval_row, scheduler)
        show_intervals(rows, write, marks, as_json)
        return
    prepare_places(out, write, marks)
    if pose not in ("random", "identity"):
        raise InputError(f"--pose: '{pose}' is not valid; give random or identity")
    base = [f"method={method}", *(["align=none"] if pose == "identity" else [])]
    varied = [text for text in base if text.partition("=")[0] not in {name.partition("=")[0] for name in vary or ()}]
    request = VariationRequest(size, noise, points, tolerance, vary or (), [*varied, *(settings or ())], against or ())
    planned = suite.make_cases(cases, seed, chosen, pose, request, Registry.discover())
    rows = run_counted(planned, out, "cases.jsonl", jobs, timeout, format_row, scheduler)
    first = ["part"] if len(chosen) > 1 or not collect_axes(rows) else []
    write_report(rows, first, "mm", out, plots, as_json)
    typer.echo(f"\n{summarise(rows, 'mm')}", err=as_json)
    if write:
        write.write_text(
            replace_between_marks(
                write, make_readme_tables(rows, first + list(collect_axes(rows)), "mm", format_command()), marks
            ),
            encoding="utf-8",
        )


@app.command("matrix")
def matrix_command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files whose scan is simulated.")],
    stage: Annotated[list[str] | None, typer.Option(help="Only this stage. May be repeated.")] = None,
    workers: Annotated[int, typer.Option(help="Runs at the same time. More than 1 makes each run slower.")] = 1,
    timeout: Timeout = 300,
    write: Write = None,
    marks: Annotated[str, typer.Option(help="Name in the marks of --write.")] = "matrix",
    as_json: AsJson = False,
) -> None:
    """Measure IoU, time and memory of every implementation. The other stages are at default."""
    from damageest.registry import Registry
    from damageest_benchmarks.matrix import run_matrix
    from damageest_benchmarks.readme import make_matrix_table, replace_between_marks

    prepare_places(None, write, marks)
    cells = run_matrix(jobs, Registry.discover(), stage or (), workers, timeout, _print_cell)
    show_table(make_matrix_table(cells), list(map(asdict, cells)), as_json)
    if write:
        write.write_text(replace_between_marks(write, make_matrix_table(cells, legend=False), marks), encoding="utf-8")


def _print_cell(cell: MatrixCell) -> None:
    figures = f"IoU {cell.iou:.4f}, {cell.seconds:.1f} s, {cell.megabytes:.0f} MB"
    what = ", ".join([*([figures] if cell.iou == cell.iou else []), *([cell.refused] if cell.refused else [])])
    typer.echo(f"{cell.stage}: {cell.use}: {cell.job}: {what}", err=True)
