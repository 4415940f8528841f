"""`damageest faces`: lists the CAD faces of a part, with the numbers and names by which a job selects them."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with
from damageest.cli._streams import say

if TYPE_CHECKING:
    from damageest.stages.part import CadFace


def command(
    part: Annotated[Path, typer.Argument(help="CAD file of the part: STEP, IGES or BREP.")],
    units: Annotated[str, typer.Option(help="Unit of the printed lengths: um, mm, cm, m, in, ft.")] = "mm",
    as_json: AsJson = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """List the CAD faces of a part. With number, name, kind, area, centre, and normal, or axis and radius."""
    end_with(lambda: _list_faces(part, units, as_json), as_json)


def _list_faces(part: Path, units: str, as_json: bool) -> int:
    from damageest.errors import JobError
    from damageest.geometry.units import canonical_unit
    from damageest.isolation import Limits
    from damageest.job import load
    from damageest.pipeline.calls import call_implementation
    from damageest.registry import Registry
    from damageest.stages.part import ReadPart
    from damageest.stages.scan import ReadScan

    unit = canonical_unit(units)
    try:  # the part is checked in the same way as in a job; no scan is needed
        job = load({"version": 1, "units": unit, "part": str(part)}, Registry.discover(), given={ReadScan: None})
    except JobError as error:
        raise JobError(error.faults, str(part)) from None
    reader, item = job.stages[ReadPart], job.implementations[ReadPart]
    assert isinstance(reader, ReadPart)
    faces = call_implementation(reader.cad_faces, {"unit": unit}, reader, item, Limits())
    if as_json:
        say_json({"part": part, "units": unit, "faces": [asdict(face) for face in faces]})
    else:
        _print_table(faces, unit)
    return 0


def _print_table(faces: tuple[CadFace, ...], unit: str) -> None:
    from rich.console import Console
    from rich.table import Table

    from damageest.errors import clean_message

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    named = any(face.name for face in faces)
    table.add_column("face", justify="right")
    for name in (*(("name",) if named else ()), "kind"):
        table.add_column(name)
    table.add_column(f"area {unit}²", justify="right")
    table.add_column(f"centre {unit}")
    table.add_column("normal, or axis and radius")
    for face in faces:
        row = (str(face.number), *((clean_message(face.name, 200),) if named else ()), face.kind)
        table.add_row(*row, f"{face.area:.6g}", _format_vector(face.centre), _describe_shape(face, unit))
    # wider than any row, so that rich does not truncate cells
    Console(highlight=False, markup=False, emoji=False, width=240).print(table)
    say(f"{len(faces)} faces; select them in a job by number{' or name' if named else ''}")


def _describe_shape(face: CadFace, unit: str) -> str:
    texts = [
        f"normal {_format_vector(face.normal)}" if face.normal else "",
        f"axis {_format_vector(face.axis)}" if face.axis else "",
        f"through {_format_vector(face.point)}" if face.axis and face.point else "",
        f"centre {_format_vector(face.point)}" if face.point and not face.axis else "",
        f"radius {face.radius:.6g} {unit}" if face.radius else "",
        "hollow" if face.hollow else "",
    ]
    return ", ".join(filter(None, texts))


def _format_vector(vector: tuple[float, float, float] | None) -> str:
    return "" if vector is None else "(" + ", ".join(f"{x if abs(x) >= 1e-9 else 0.0:.5g}" for x in vector) + ")"
