"""`damageest evaluate`: accuracy and cost against known truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from damageest.evaluate.matrix import Cell

app = typer.Typer(no_args_is_help=True, help="Measure accuracy and cost against known truth.")


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
        placed(write, None)  # a file without the marks is refused before hours of work
    cells = matrix(jobs, Registry.discover(), stage or (), workers, timeout, _tell)
    made = table(cells)
    typer.echo(made)
    if write:
        write.write_text(placed(write, made))


def _tell(cell: Cell) -> None:
    figures = f"IoU {cell.iou:.4f}, {cell.seconds:.1f} s, {cell.megabytes:.0f} MB"
    what = ", ".join([*([figures] if cell.iou == cell.iou else []), *([cell.refused] if cell.refused else [])])
    typer.echo(f"{cell.stage}: {cell.use}: {cell.job}: {what}", err=True)
