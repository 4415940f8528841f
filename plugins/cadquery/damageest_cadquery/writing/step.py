"""Writes solids as STEP: planar faces, the job's unit, a product name, and the same bytes each time.

It is done in a process of its own, since OpenCASCADE can crash; each file is read back there before it is moved into
place.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.artefacts import Solid
from damageest.errors import InputError
from damageest.geometry.units import MILLIMETRES
from damageest.isolation import Limits, ProcessError, call_isolated, tell_part
from damageest.stages.export import Body, ExportedFiles
from damageest_cadquery.solids.planar import build_shape, count_faces, find_shells, split_solids
from damageest_cadquery.writing._header import set_header

UNITS = {"um": "UM", "mm": "MM", "cm": "CM", "m": "M", "in": "INCH", "ft": "FT"}
FACET_SECONDS = 60.0
"""Longest time of the processor to write one file with facets, or a spline, and to read it back."""
MAX_FACES = 100_000
"""Largest number of planar faces in a STEP file; 60,000 took 11 s to write, 22 s to read, and 67 MB."""


@dataclass(frozen=True, eq=False)
class Way:
    """How a file may be written. ``said``: in words that follow "written"; ``make``: makes what is to be written, and
    ``write`` writes it to a path; ``gather``: all of it as one shape."""

    said: str
    make: Callable[[], Any]
    write: Callable[[Path, Any], None]
    gather: Callable[[Any], Any] = lambda made: made


@dataclass(frozen=True, eq=False)
class Outcome:
    """``made``: what was written, None where there is no file. ``said``: what is to be said of the file, in words that
    follow its name; empty where the first way served. ``fault``: why the first way did not. ``is_valid``: False
    where the file is one that other programs may refuse."""

    made: Any
    said: str = ""
    fault: str = ""
    is_valid: bool = True


class TooManyFacesError(Exception):
    """A solid has more planar faces than a STEP file is to hold; the message is their number."""


def write_step(folder: Path, stem: str, solids: Sequence[Body], unit: str) -> ExportedFiles:
    """Writes one solid as faceted STEP. With too many faces, or where it cannot be read back, the file is left out, and
    a note says so."""
    (body,) = solids
    tell_part(f"STEP with facets: {stem}.step")
    try:
        said = call_in_process(write_facets, folder / f"{stem}.step", body.solid, body.name, unit, MAX_FACES)
    except TooManyFacesError as error:
        note = (
            f"{stem}.step was not written: {error} planar faces are more than the limit of {MAX_FACES}; "
            "set a larger  detail , or use 3mf"
        )
        return ExportedFiles(notes=(note,))
    except ProcessError as error:
        said = f"was not written: the process that writes it {error.message}"
        if error.why == "time":
            said = (
                f"was not written: with facets, OpenCASCADE takes longer than {FACET_SECONDS:g} s of the processor to "
                "write and read it; set a larger  detail , or use 3mf"
            )
    notes = (f"{stem}.step {said}",) if said else ()
    files = tuple(name for name in (f"{stem}.step", f"{stem}-invalid.step") if (folder / name).is_file())
    return ExportedFiles(files, notes, warnings=notes)


def call_in_process(function: Callable[..., str], path: Path, *values: Any) -> str:
    """What ``function`` gives for a scratch file, ``path`` and the ``values``, called in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="damageest-step-") as place:
        arguments = {"scratch": Path(place) / "a.step", "path": path, "values": values}
        return call_isolated(
            _call, {"function": function, **arguments}, worker="damageest_cadquery step", owner=OWNER,
            limits=Limits(seconds=FACET_SECONDS), processor_time=True,
        )  # fmt: skip


OWNER = "damageest-cadquery"


def _call(function: Callable[..., str], scratch: Path, path: Path, values: Sequence[Any]) -> str:
    return function(scratch, path, *values)


def write_facets(scratch: Path, path: Path, solid: Solid, name: str, unit: str, most: int) -> str:
    """Writes a solid with planar faces; gives a note on the file, empty where it was written as asked for.

    Raises TooManyFacesError where it has more than ``most``.
    """
    scale = MILLIMETRES[unit]

    def make(joined: bool) -> Any:
        shells = find_shells(solid, joined)
        if count_faces(shells) > most:
            raise TooManyFacesError(str(count_faces(shells)))
        return build_shape(shells, scale)

    volumes = [
        (outer.volume - sum(cavity.volume for cavity in cavities)) * scale**3 for outer, cavities in split_solids(solid)
    ]

    def write(place: Path, shape: Any) -> None:
        write_shape(place, shape, name, unit)

    ways = (
        Way("with planar faces", lambda: make(True), write),
        Way("with a face for each triangle", lambda: make(False), write),
    )
    return write_first(scratch, path, ways, volumes).said


def write_first(scratch: Path, path: Path, ways: Iterable[Way], volumes: Sequence[float] = ()) -> Outcome:
    """Writes a file in the first of several ways in which it holds what it is to hold when it is read back.

    Where there is none, the first complete one gets the name that `mark_invalid` gives, since OpenCASCADE divides its
    solids in another way or finds them not valid; else there is no file. ``scratch``: where files are written and read
    back; ``volumes``: of the solids, where they are known better than from the shape.
    """
    from damageest_cadquery.writing.readback import COMPLETE, find_fault  # imported late: the caller does not need it

    faults: list[str] = []
    doubtful, spare = Outcome(None), scratch.with_name("doubtful.step")
    for way in ways:
        try:
            made = way.make()
        except (TooManyFacesError, InputError):
            if not faults:
                raise
            break
        try:
            way.write(scratch, made)
            fault = find_fault(scratch, way.gather(made), volumes)
        except OSError as error:
            fault = str(error).removeprefix(f"{scratch}: ")
        if not fault:
            shutil.move(scratch, path)
            return (
                Outcome(made, f"was written {way.said}: read back before, {faults[0]}", faults[0])
                if faults
                else Outcome(made)
            )
        faults.append(fault)
        if fault.endswith(COMPLETE) and doubtful.made is None:
            shutil.move(scratch, spare)
            told = f"is called {mark_invalid(path).name}, since other programs may refuse it: read back, {fault}"
            doubtful = Outcome(made, told, fault, is_valid=False)
    if doubtful.made is None:
        return Outcome(None, f"was not written: read back, {faults[0]}", faults[0])
    shutil.move(spare, mark_invalid(path))
    return doubtful


def mark_invalid(path: Path) -> Path:
    """The name of a file that other programs may refuse: no one takes it for the one that was asked for."""
    return path.with_name(f"{path.stem}-invalid{path.suffix}")


def write_shape(path: Path, shape: Any, name: str, unit: str, curves: bool = False) -> None:
    """Writes an OpenCASCADE shape, in millimetres, as STEP in ``unit``.

    ``curves``: also write edges as curves in the parameters of the faces; planes do not need them. Raises OSError where
    the file cannot be written.
    """
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Controller, STEPControl_Writer

    Message.DefaultMessenger_s().ChangePrinters().Clear()  # else OpenCASCADE prints to the terminal
    STEPControl_Controller.Init_s()
    wanted = {"write.step.unit": UNITS[unit], "write.step.product.name": "damageest"}
    before = {key: Interface_Static.CVal_s(key) for key in wanted}
    numbers = {"write.surfacecurve.mode": int(curves), "write.step.assembly": 0}  # the latter: one product
    earlier = {key: Interface_Static.IVal_s(key) for key in numbers}
    try:
        for key, value in wanted.items():
            Interface_Static.SetCVal_s(key, value)
        for key, number in numbers.items():
            Interface_Static.SetIVal_s(key, number)
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        set_header(writer.Model(), name)
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OSError(f"{path}: OpenCASCADE could not write it")
    finally:
        for key, value in before.items():
            Interface_Static.SetCVal_s(key, value)
        for key, number in earlier.items():
            Interface_Static.SetIVal_s(key, number)
