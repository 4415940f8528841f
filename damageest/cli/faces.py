"""`damageest faces`: the CAD faces of a part, by the numbers and names that a job may choose them by."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from damageest.stages.part import CadFace


def command(
    part: Annotated[Path, typer.Argument(help="The part as designed: STEP, IGES or BREP.")],
    units: Annotated[str, typer.Option(help="Unit to show lengths in: um, mm, cm, m, in, ft.")] = "mm",
    as_json: Annotated[bool, typer.Option("--json", help="Print the faces as JSON.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """List a part's CAD faces: number, name, kind, area, centre, and normal, or axis and radius."""
    from damageest.errors import JobError
    from damageest.geometry.units import canonical_unit
    from damageest.job import load
    from damageest.registry import Registry
    from damageest.stages.part import ReadPart
    from damageest.stages.scan import ReadScan

    unit = canonical_unit(units)
    try:  # as a job's part is found and checked; no scan is needed
        job = load({"version": 1, "units": unit, "part": str(part)}, Registry.discover(), given={ReadScan: None})
    except JobError as error:
        raise JobError(error.faults, str(part)) from None
    reader = job.stages[ReadPart]
    assert isinstance(reader, ReadPart)
    faces = reader.cad_faces(unit)
    if as_json:
        typer.echo(json.dumps({"part": str(part), "units": unit, "faces": [asdict(face) for face in faces]}, indent=1))
    else:
        _table(faces, unit)


def _table(faces: tuple[CadFace, ...], unit: str) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    named = any(face.name for face in faces)
    table.add_column("face", justify="right")
    for name in (*(("name",) if named else ()), "kind"):
        table.add_column(name)
    table.add_column(f"area {unit}²", justify="right")
    table.add_column(f"centre {unit}")
    table.add_column("normal, or axis and radius")
    for face in faces:
        row = (str(face.number), *((face.name,) if named else ()), face.kind)
        table.add_row(*row, f"{face.area:.6g}", _numbers(face.centre), _shape(face, unit))
    # wide enough for any row: a narrow terminal breaks lines itself
    Console(highlight=False, markup=False, width=240).print(table)
    typer.echo(f"{len(faces)} faces; a job names them by number{' or name' if named else ''}")


def _shape(face: CadFace, unit: str) -> str:
    said = [
        f"normal {_numbers(face.normal)}" if face.normal else "",
        f"axis {_numbers(face.axis)}" if face.axis else "",
        f"through {_numbers(face.point)}" if face.axis and face.point else "",
        f"about {_numbers(face.point)}" if face.point and not face.axis else "",
        f"radius {face.radius:.6g} {unit}" if face.radius else "",
        "hollow" if face.hollow else "",
    ]
    return ", ".join(filter(None, said))


def _numbers(vector: tuple[float, float, float] | None) -> str:
    return "" if vector is None else "(" + ", ".join(f"{x if abs(x) >= 1e-9 else 0.0:.5g}" for x in vector) + ")"
