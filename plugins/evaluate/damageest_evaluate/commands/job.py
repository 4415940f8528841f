"""`damageest evaluate job`: which damage is found on a user's part by a user's scanner."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from damageest_evaluate.commands.counted import AsJson, format_command, prepare_folder, run_counted, show_table

app = typer.Typer(
    no_args_is_help=True, help="Measure accuracy and cost against known truth. A clone of damageest has suites too."
)
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

    prepare_folder(out)
    if scheduler and not out:
        raise InputError("--scheduler: give --out too, a folder that the cluster sees: the part is put there")
    request = VariationRequest(size, noise, points, tolerance, vary or (), settings or (), against or ())
    place = out.resolve() if out and scheduler else None
    with tempfile.TemporaryDirectory(prefix="damageest-evaluate-", dir=place) as folder:
        study = plan_study(job, request, seeds, Registry.discover(), Path(folder))
        for note in study.notes:
            typer.echo(note, err=as_json)
        rows = run_counted(study.cases, out, "cases.jsonl", jobs, timeout, format_row, scheduler)
    write_report(rows, [], study.unit, out, plots, as_json)
    typer.echo(f"\n{summarise(rows, study.unit)}", err=as_json)


def write_report(
    rows: list[dict[str, Any]], first: list[str], unit: str, out: Path | None, plots: bool, as_json: bool
) -> None:
    """Prints the tables of ``rows``, or them as JSON; writes files and plots into ``out``."""
    from damageest_evaluate.figures import collect_axes
    from damageest_evaluate.plots import draw_plots
    from damageest_evaluate.report import format_tables, write_files

    show_table(format_tables(rows, [*first, *collect_axes(rows)], unit), rows, as_json)
    if out:
        write_files(rows, unit, out, format_command())
        paths = draw_plots(rows, unit, out) if plots else []
        names = ", ".join(sorted({path.stem for path in paths}))
        typer.echo(f"written to {out}" + (f", with plots: {names}" if paths else ""), err=as_json)
