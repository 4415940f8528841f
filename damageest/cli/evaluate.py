"""`damageest evaluate`: accuracy and cost against known truth."""

from __future__ import annotations

import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from damageest.evaluate._case import Case
    from damageest.evaluate.matrix import Cell

app = typer.Typer(no_args_is_help=True, help="Measure accuracy and cost against known truth.")

Vary = Annotated[
    list[str] | None,
    typer.Option(metavar="STAGE.OPTION=A,B,C", help="stage=a,b and method=a,b as well; may be given repeatedly."),
]
Against = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SETTINGS", help="Another way to compare with, as 'method=octree enclose.depth=8'; may be repeated."
    ),
]
Noise = Annotated[str, typer.Option(metavar="A,B", help="Multiples of the scan's noise, or lengths as 0.02mm.")]
Points = Annotated[str, typer.Option(metavar="A,B", help="Points of a scan.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="stage.option=value or field=value, for every case.")]
Jobs = Annotated[int, typer.Option(min=1, help="Cases at a time; times are those of a busy machine then.")]
Timeout = Annotated[float, typer.Option(min=0, help="Seconds for one run.")]
Out = Annotated[
    Path | None,
    typer.Option(file_okay=False, help="Folder for cases.jsonl (to go on from), cases.csv, summary.json and plots."),
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Whether to draw plots into --out.")]


@app.command("job")
def job_command(
    job: Annotated[Path, typer.Argument(metavar="JOB", help="Its part is used, and a scanner like its scan's.")],
    vary: Vary = None,
    against: Against = None,
    seeds: Annotated[int, typer.Option(min=1, help="Random damages of each size.")] = 10,
    size: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="Depths in the job's unit, or as 4x tolerance; 0: no damage. any: of all kinds and sizes.",
        ),
    ] = "",
    noise: Noise = "",
    points: Points = "",
    tolerance: Annotated[str, typer.Option(metavar="A,B", help="Lengths, times the job's as 2x, or auto.")] = "",
    settings: Settings = None,
    jobs: Jobs = 2,
    timeout: Timeout = 300,
    out: Out = None,
    plots: Plots = True,
) -> None:
    """How deep a damage has to be to be found on your part with your scanner, and how well it is found.

    Random damages are taken off the job's part and scanned virtually, with the noise and density of the job's scan;
    damage that the job itself simulates is left out. Without --size: none, and depths of 2, 4, 8 and 16 tolerances.
    """
    from damageest.evaluate._figures import sentence
    from damageest.evaluate._vary import Wanted
    from damageest.evaluate.job import study
    from damageest.registry import Registry

    _ready(out, plots)
    wanted = Wanted(size, noise, points, tolerance, vary or (), settings or (), against or ())
    with tempfile.TemporaryDirectory(prefix="damageest-evaluate-") as place:
        found = study(job, wanted, seeds, Registry.discover(), Path(place))
        for note in found.notes:
            typer.echo(note)
        rows = _rows(found.cases, jobs, timeout, out)
    _report(rows, [], found.unit, out, plots)
    typer.echo(f"\n{sentence(rows, found.unit)}")


@app.command("suite")
def suite_command(
    cases: Annotated[int, typer.Option(help="Random damages; they go through the parts in turn.")] = 26,
    seed: Annotated[int, typer.Option(min=0, help="Of the damages, scans and poses.")] = 0,
    parts: Annotated[str, typer.Option(metavar="A,B", help="Names of built-in parts; default: all.")] = "",
    method: Annotated[str, typer.Option(help="auto, implicit, surface or octree.")] = "auto",
    pose: Annotated[str, typer.Option(help="random, or identity: the pose is known.")] = "random",
    vary: Vary = None,
    against: Against = None,
    size: Annotated[str, typer.Option(metavar="A,B", help="Depths in mm, or as 4x tolerance; 0: none.")] = "any",
    noise: Noise = "",
    points: Points = "",
    tolerance: Annotated[str, typer.Option(metavar="A,B", help="Multiples of the noise, lengths as 1mm, auto.")] = "4",
    settings: Settings = None,
    jobs: Jobs = 2,
    timeout: Timeout = 300,
    out: Out = None,
    plots: Plots = True,
    write: Annotated[
        Path | None, typer.Option(help="A text file whose lines between the marks are replaced by the tables.")
    ] = None,
    marks: Annotated[str, typer.Option(help="Name of those marks.")] = "suite",
) -> None:
    """Random damages on thirteen built-in parts, through the whole route."""
    from damageest.errors import InputError
    from damageest.evaluate import suite
    from damageest.evaluate._figures import axes_of, sentence
    from damageest.evaluate._report import readme_table
    from damageest.evaluate._table import placed
    from damageest.evaluate._vary import Wanted
    from damageest.evaluate.parts import PARTS
    from damageest.registry import Registry

    _ready(out, plots)
    if write:
        placed(write, None, marks)  # a file without the marks is refused before hours of work
    if pose not in ("random", "identity"):
        raise InputError(f"--pose: random or identity, not '{pose}'")
    base = [f"method={method}", *(["align=none"] if pose == "identity" else [])]
    varied = [text for text in base if text.partition("=")[0] not in {name.partition("=")[0] for name in vary or ()}]
    wanted = Wanted(size, noise, points, tolerance, vary or (), [*varied, *(settings or ())], against or ())
    chosen = [name.strip() for name in parts.split(",")] if parts else list(PARTS)
    rows = _rows(suite.cases(cases, seed, chosen, pose, wanted, Registry.discover()), jobs, timeout, out)
    first = ["part"] if len(chosen) > 1 or not axes_of(rows) else []
    _report(rows, first, "mm", out, plots)
    typer.echo(f"\n{sentence(rows, 'mm')}")
    if write:
        write.write_text(placed(write, readme_table(rows, first + list(axes_of(rows)), "mm", _command()), marks))


def _ready(out: Path | None, plots: bool) -> None:
    from damageest.evaluate._plots import require

    if out and plots:
        require()
    if out:
        out.mkdir(parents=True, exist_ok=True)


def _rows(cases: Sequence[Case], jobs: int, timeout: float, out: Path | None) -> list[dict[str, Any]]:
    from damageest.evaluate._report import line
    from damageest.evaluate._run import run_all

    count = 0

    def tell(row: dict[str, Any]) -> None:
        nonlocal count
        count += 1
        typer.echo(f"[{count}/{len(cases)}] {line(row)}", err=True)

    return run_all(cases, out / "cases.jsonl" if out else None, jobs, timeout, tell)


def _report(rows: list[dict[str, Any]], first: list[str], unit: str, out: Path | None, plots: bool) -> None:
    from damageest.evaluate._figures import axes_of
    from damageest.evaluate._plots import draw
    from damageest.evaluate._report import tables, write_files

    typer.echo("\n" + tables(rows, [*first, *axes_of(rows)], unit))
    if out:
        write_files(rows, unit, out, _command())
        made = draw(rows, unit, out) if plots else []
        names = ", ".join(sorted({path.stem for path in made}))
        typer.echo(f"written to {out}" + (f", with plots: {names}" if made else ""))


def _command() -> str:
    """The command line, without where its output goes."""
    words, places = sys.argv[1:], ("--out", "--write", "--marks")
    kept = [
        word
        for before, word in zip(["", *words], words, strict=False)
        if before not in places and word.partition("=")[0] not in places
    ]
    return shlex.join(["damageest", *kept])


@app.command("matrix")
def matrix_command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Jobs whose scan is simulated.")],
    stage: Annotated[list[str] | None, typer.Option(help="Only this stage; may be given repeatedly.")] = None,
    workers: Annotated[int, typer.Option(help="Runs at a time; times are those of a busy machine then.")] = 1,
    timeout: Annotated[float, typer.Option(help="Seconds for one run.")] = 300,
    write: Annotated[
        Path | None, typer.Option(help="A text file whose lines between the matrix marks are replaced by the table.")
    ] = None,
) -> None:
    """Every implementation of every stage on the jobs, the others at default: IoU, time, memory, or why it refused."""
    from damageest.evaluate._table import placed, table
    from damageest.evaluate.matrix import matrix
    from damageest.registry import Registry

    if write:
        placed(write, None, "matrix")  # a file without the marks is refused before hours of work
    cells = matrix(jobs, Registry.discover(), stage or (), workers, timeout, _tell)
    made = table(cells)
    typer.echo(made)
    if write:
        write.write_text(placed(write, made, "matrix"))


def _tell(cell: Cell) -> None:
    figures = f"IoU {cell.iou:.4f}, {cell.seconds:.1f} s, {cell.megabytes:.0f} MB"
    what = ", ".join([*([figures] if cell.iou == cell.iou else []), *([cell.refused] if cell.refused else [])])
    typer.echo(f"{cell.stage}: {cell.use}: {cell.job}: {what}", err=True)
