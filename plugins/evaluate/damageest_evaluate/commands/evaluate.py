"""`damageest evaluate`: measures accuracy and cost against known truth."""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damageest_evaluate.commands import (
    adapt,
    budget,
    difference,
    family,
    honesty,
    inspections,
    named,
    path,
    prepare,
    real,
    realistic,
    sections,
    speed,
    steady,
    worn,
)
from damageest_evaluate.commands._counted import AsJson, format_command, prepare_places, run_counted, show_table
from damageest_evaluate.commands.intervals import show_intervals

if TYPE_CHECKING:
    from damageest_evaluate.matrix import MatrixCell

app = typer.Typer(no_args_is_help=True, help="Measure accuracy and cost against known truth.")
app.command("adapt")(adapt.command)
app.command("budget")(budget.command)
app.command("difference")(difference.command)
app.command("family")(family.command)
app.command("honesty")(honesty.command)
app.command("inspections")(inspections.command)
app.command("named")(named.command)
app.command("real")(real.command)
app.command("realistic")(realistic.command)
app.command("steady")(steady.command)
app.command("sections")(sections.command)
app.command("speed")(speed.command)
app.command("worn")(worn.command)
app.command("path")(path.command)
app.command("prepare")(prepare.command)

Vary = Annotated[
    list[str] | None,
    typer.Option(
        metavar="STAGE.OPTION=A,B,C", help="Values to compare; also stage=a,b or method=a,b. Repeat it to vary several."
    ),
]
Against = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SETTINGS",
        help="Other settings to compare with, for example 'method=octree enclose.depth=8'. May be repeated.",
    ),
]
Noise = Annotated[
    str,
    typer.Option(metavar="A,B", help="Noise of the scan: multiples of its default, or lengths, for example 0.02mm."),
]
Points = Annotated[str, typer.Option(metavar="A,B", help="Number of points of the scan.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="Replace a value of the job in all cases: stage.option=value or field=value."),
]
Jobs = Annotated[int, typer.Option(min=1, help="Cases that run at the same time. More than 1 makes each run slower.")]
Timeout = Annotated[float, typer.Option(min=0, help="Seconds after which a run is stopped.")]
Scheduler = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Run on the Dask cluster at this address, instead of --jobs here.")
]
Out = Annotated[
    Path | None,
    typer.Option(file_okay=False, help="Folder for cases.jsonl (to resume from), cases.csv, summary.json and plots."),
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw plots into the folder of --out.")]


@app.command("job")
def job_command(
    job: Annotated[
        Path, typer.Argument(metavar="JOB", help="Job file. Its part is used, and a scanner similar to its scan.")
    ],
    vary: Vary = None,
    against: Against = None,
    seeds: Annotated[int, typer.Option(min=1, help="Number of random damages of each size.")] = 10,
    size: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="Depths of the damage in the job's unit, or 4x for 4 tolerances. 0: none; any: all kinds and sizes.",
        ),
    ] = "",
    noise: Noise = "",
    points: Points = "",
    tolerance: Annotated[
        str, typer.Option(metavar="A,B", help="Lengths, 2x for 2 times the job's tolerance, or auto.")
    ] = "",
    settings: Settings = None,
    jobs: Jobs = 2,
    timeout: Timeout = 300,
    scheduler: Scheduler = "",
    out: Out = None,
    plots: Plots = True,
    as_json: AsJson = False,
) -> None:
    """Measure which damage your scanner shows on your part. By depth, with its accuracy.

    Random damages are removed from the job's part. The part is then scanned virtually, with the noise and the density
    of the job's scan. Damage that the job itself simulates is not used. Default sizes: no damage, and depths of 2, 4, 8
    and 16 tolerances.
    """
    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_evaluate.figures import summarise
    from damageest_evaluate.job import plan_study
    from damageest_evaluate.report import format_row
    from damageest_evaluate.variants import VariationRequest

    prepare_places(out)
    if scheduler and not out:
        raise InputError("--scheduler: give --out too, a folder that the cluster sees: the part is put there")
    request = VariationRequest(size, noise, points, tolerance, vary or (), settings or (), against or ())
    place = out.resolve() if out and scheduler else None
    with tempfile.TemporaryDirectory(prefix="damageest-evaluate-", dir=place) as folder:
        study = plan_study(job, request, seeds, Registry.discover(), Path(folder))
        for note in study.notes:
            typer.echo(note, err=as_json)
        rows = run_counted(study.cases, out, "cases.jsonl", jobs, timeout, format_row, scheduler)
    _write_report(rows, [], study.unit, out, plots, as_json)
    typer.echo(f"\n{summarise(rows, study.unit)}", err=as_json)


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
    write: Annotated[
        Path | None, typer.Option(help="Text file. Its lines between the marks are replaced by the tables.")
    ] = None,
    marks: Annotated[
        str, typer.Option(help="Name in the marks <!-- NAME: begin --> and <!-- NAME: end --> of --write.")
    ] = "suite",
) -> None:
    """Measure accuracy on random damages of built-in parts. Thirteen parts, from scan to damage volume."""
    from damageest.errors import InputError
    from damageest.registry import Registry
    from damageest_evaluate import suite
    from damageest_evaluate.figures import collect_axes, summarise
    from damageest_evaluate.intervals import format_interval_row, make_interval_cases
    from damageest_evaluate.parts import PARTS
    from damageest_evaluate.readme import replace_between_marks
    from damageest_evaluate.report import format_row, make_readme_tables
    from damageest_evaluate.variants import VariationRequest

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
    _write_report(rows, first, "mm", out, plots, as_json)
    typer.echo(f"\n{summarise(rows, 'mm')}", err=as_json)
    if write:
        write.write_text(
            replace_between_marks(
                write, make_readme_tables(rows, first + list(collect_axes(rows)), "mm", format_command()), marks
            ),
            encoding="utf-8",
        )


def _write_report(
    rows: list[dict[str, Any]], first: list[str], unit: str, out: Path | None, plots: bool, as_json: bool
) -> None:
    from damageest_evaluate.figures import collect_axes
    from damageest_evaluate.plots import draw_plots
    from damageest_evaluate.report import format_tables, write_files

    show_table(format_tables(rows, [*first, *collect_axes(rows)], unit), rows, as_json)
    if out:
        write_files(rows, unit, out, format_command())
        paths = draw_plots(rows, unit, out) if plots else []
        names = ", ".join(sorted({path.stem for path in paths}))
        typer.echo(f"written to {out}" + (f", with plots: {names}" if paths else ""), err=as_json)


@app.command("matrix")
def matrix_command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files whose scan is simulated.")],
    stage: Annotated[list[str] | None, typer.Option(help="Only this stage. May be repeated.")] = None,
    workers: Annotated[int, typer.Option(help="Runs at the same time. More than 1 makes each run slower.")] = 1,
    timeout: Annotated[float, typer.Option(help="Seconds after which a run is stopped.")] = 300,
    write: Annotated[
        Path | None, typer.Option(help="Text file. Its lines between the matrix marks are replaced by the table.")
    ] = None,
    marks: Annotated[str, typer.Option(help="Name in the marks of --write.")] = "matrix",
    as_json: AsJson = False,
) -> None:
    """Measure IoU, time and memory of every implementation. The other stages are at default."""
    from damageest.registry import Registry
    from damageest_evaluate.matrix import run_matrix
    from damageest_evaluate.readme import make_matrix_table, replace_between_marks

    prepare_places(None, write, marks)
    cells = run_matrix(jobs, Registry.discover(), stage or (), workers, timeout, _print_cell)
    show_table(make_matrix_table(cells), list(map(asdict, cells)), as_json)
    if write:
        write.write_text(replace_between_marks(write, make_matrix_table(cells, legend=False), marks), encoding="utf-8")


def _print_cell(cell: MatrixCell) -> None:
    figures = f"IoU {cell.iou:.4f}, {cell.seconds:.1f} s, {cell.megabytes:.0f} MB"
    what = ", ".join([*([figures] if cell.iou == cell.iou else []), *([cell.refused] if cell.refused else [])])
    typer.echo(f"{cell.stage}: {cell.use}: {cell.job}: {what}", err=True)
