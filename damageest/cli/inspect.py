"""`damageest inspect`: compares a scan made after a step of a repair with what the step was to give."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with
from damageest.cli._streams import say


class ElsewhereName(StrEnum):
    """What is found at no site decides on the part, or is only listed."""

    decides = "decides"
    listed = "listed"


class StepName(StrEnum):
    """A step of a repair."""

    deposited = "deposited"
    milled = "milled"


def command(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of the run before the repair.")],
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="Scan of the part after the step.")],
    step: Annotated[StepName, typer.Option("--step", help="Repair step before this scan.")],
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", help="Allowed deviation, in the job's unit; default: the job's.")
    ] = None,
    same_setup: Annotated[
        bool, typer.Option("--same-setup", help="Use the pose of the previous scan: the part was not moved.")
    ] = False,
    defect: Annotated[
        float | None,
        typer.Option(
            "--defect", help="Width of the least defect that matters, in the job's unit; default: 15 tolerances."
        ),
    ] = None,
    elsewhere: Annotated[
        ElsewhereName | None,
        typer.Option(
            "--elsewhere", help="Whether findings outside all sites make the part not met; default: the job's."
        ),
    ] = None,
    scan_unit: Annotated[
        str | None, typer.Option("--scan-unit", help="Unit of the scan's file; default: that of the job's scan.")
    ] = None,
    part_temperature: Annotated[
        float | None,
        typer.Option("--part-temperature", help="Temperature of the part at this scan, in °C; default: the job's."),
    ] = None,
    fixture: Annotated[
        list[str] | None,
        typer.Option("--fixture", metavar="X,Y,Z,X,Y,Z", help="Box around a fixture. May be repeated."),
    ] = None,
    as_json: AsJson = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Compare a scan after a repair step with its target. Lists missing and excess metal, and adds the result to the
    record in OUT."""
    asked: dict[str, Any] = {"tolerance": tolerance, "same_setup": same_setup, "defect": defect}
    asked |= {"scan_unit": scan_unit, "part_temperature": part_temperature}
    if elsewhere is not None:
        asked["elsewhere"] = elsewhere.value
    end_with(lambda: _inspect(folder, scan, step.value, asked, fixture or [], as_json), as_json)


def _read_box(text: str) -> dict[str, list[float]]:
    """A box from the six coordinates of its corners."""
    from damageest.errors import Fault, JobError

    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 6 or not all(low < high for low, high in zip(values[:3], values[3:], strict=True)):
        text = f"give a box by its lowest and highest corner, for example 0,0,0,10,10,5, not '{text}'"
        raise JobError([Fault(text)], "--fixture")
    return {"min": values[:3], "max": values[3:]}


def _inspect(folder: Path, scan: Path, step: str, asked: dict[str, Any], fixtures: list[str], as_json: bool) -> int:
    """Prints what was found, and gives the exit status: 1 where a tolerance is not met or not shown."""
    from damageest.errors import Fault, InputError, JobError
    from damageest.inspection.aim import read_aim
    from damageest.inspection.compare import ask, inspect_step
    from damageest.inspection.discrepancies import name_places
    from damageest.inspection.page import write_page
    from damageest.inspection.record import NAME, PAGE, append_inspection, read_record
    from damageest.io.files import check_output_file

    for name in ("tolerance", "defect"):
        if asked[name] is not None and not 0 < asked[name] < float("inf"):
            raise JobError([Fault(f"a {name} is a number above 0, not {asked[name]}")], f"--{name}")
    if fixtures:
        asked["fixtures"] = tuple(_read_box(text) for text in fixtures)
    if not scan.is_file():
        raise InputError(f"{scan}: there is no such file; give the scan made after the step")
    for name in (NAME, PAGE):
        check_output_file(folder / name, "OUT")
    aim = read_aim(folder, step)  # type: ignore[arg-type]
    if (folder / NAME).is_file():
        read_record(folder / NAME, aim)  # a record that cannot take the entry is said before the work
    found = inspect_step(aim, scan, ask(aim, asked))
    unit = aim.folder.unit
    for one in found.findings:
        where = name_places(one.sites)
        interval = "" if one.low is None else f", 95 %: {one.low:.4g} to {one.high or float('inf'):.4g}"
        say(f"{where}: {one.kind} {one.volume:.4g} {unit}³{interval}, by up to {one.depth:.3g} {unit} ({one.level})")
    for verdict in found.verdicts:
        why = f": {verdict.why}" if verdict.why else ""
        shows = "" if verdict.shows is None else f"; shows defects from {verdict.shows:.2g} {unit} across"
        say(f"site {verdict.site}: tolerance {found.tolerance:.3g} {unit} {verdict.outcome}{why}{shows}")
    why = f": {found.whole.why}" if found.whole.why else ""
    say(f"part as a whole: {found.whole.outcome}{why}")
    for number in aim.refused:
        say(f"note: site {number} has no accepted repair and is not inspected")
    for note in found.notes:
        say(f"note: {note}")
    record = append_inspection(aim, found, scan)
    write_page(record, folder / PAGE)
    say(f"added to {folder / NAME}, and its page {folder / PAGE}")
    if as_json:
        found_there = {"findings": list(map(asdict, found.findings)), "sites": list(map(asdict, found.verdicts))}
        told = {"folder": folder, "step": step, "units": unit, "tolerance": found.tolerance, **found_there}
        told |= {"whole": asdict(found.whole), "defect": found.defect}
        say_json({**told, "refused": list(aim.refused), "notes": list(found.notes), "record": folder / NAME})
    return 0 if found.whole.outcome == "met" else 1
