"""`damageest part`: prints the datums and tolerances that a CAD file has for programs (semantic PMI)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with
from damageest.cli._streams import say, say_result

if TYPE_CHECKING:
    from damageest.registry import Registry
    from damageest.stages.part import CadPmi, CadTolerance


def command(
    part: Annotated[Path, typer.Argument(help="CAD file of the part: STEP AP242.")],
    units: Annotated[str, typer.Option(help="Unit of the printed lengths: um, mm, cm, m, in, ft.")] = "mm",
    as_json: AsJson = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """List datums, datum systems and tolerances of a part. With the CAD faces that they refer to."""
    end_with(lambda: _list_pmi(part, units, as_json), as_json)


def read_pmi(part: str | dict[str, str], unit: str, registry: Registry) -> CadPmi:
    """Datums and tolerances of a part's file, which is named as in a job; lengths in ``unit``. Raises JobError or
    InputError as a run would."""
    from damageest.errors import JobError
    from damageest.isolation import Limits
    from damageest.job import load
    from damageest.pipeline.calls import call_implementation
    from damageest.stages.part import CadPmi, ReadPart
    from damageest.stages.scan import ReadScan

    try:  # the part is checked in the same way as in a job; no scan is needed
        job = load({"version": 1, "units": unit, "part": part}, registry, given={ReadScan: None})
    except JobError as error:
        raise JobError(error.faults, part if isinstance(part, str) else part["path"]) from None
    reader, item = job.stages[ReadPart], job.implementations[ReadPart]
    assert isinstance(reader, ReadPart)
    found = call_implementation(reader.cad_pmi, {"unit": unit}, reader, item, Limits())
    assert isinstance(found, CadPmi)
    return found


def _list_pmi(part: Path, units: str, as_json: bool) -> int:
    from damageest.geometry.units import canonical_unit
    from damageest.registry import Registry

    unit = canonical_unit(units)
    found = read_pmi(str(part), unit, Registry.discover())
    if as_json:
        say_json({"part": part, "units": unit, **asdict(found)})
        return 0
    for datum in found.datums:
        say_result(f"datum {datum.name}: {_name_faces(datum.faces)}")
    for system in found.systems:
        say_result(f"datum system {' | '.join(system)}")
    for tolerance in found.tolerances:
        say_result(_describe(tolerance, unit))
    for note in found.notes:
        say(f"note: {note}")
    return 0


def _describe(tolerance: CadTolerance, unit: str) -> str:
    from damageest.errors import clean_message

    value = "?" if tolerance.value is None else f"{tolerance.value:.6g} {unit}"
    if tolerance.limits:
        value = f"{tolerance.limits[0]:.6g} to {tolerance.limits[1]:.6g} {unit}"
    system = f" to {' | '.join(tolerance.datums)}" if tolerance.datums else ""
    name = f" ({clean_message(tolerance.name, 100)})" if tolerance.name else ""
    return f"{tolerance.kind.replace('_', ' ')} {value}{system}: {_name_faces(tolerance.faces)}{name}"


def _name_faces(faces: tuple[int, ...]) -> str:
    if not faces:
        return "no CAD face"
    return f"CAD face{'s' * (len(faces) > 1)} {', '.join(map(str, faces))}"
