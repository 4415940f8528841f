"""`damageest nominal`: the mean of several parts of one type as they were measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli._process import end_with
from damageest.cli._streams import say

if TYPE_CHECKING:
    from damageest.artefacts import Part
    from damageest.io.forms import MeasuredForm

FINE = 100.0
"""Edges along the part's diagonal of the triangles that are moved."""


def command(
    folders: Annotated[
        list[Path], typer.Argument(metavar="OUT...", help="Output folders of runs that adapted the part, one a part.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="STL or PLY file to write; its form goes beside it, in an .npz file.")
    ],
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Write the mean of parts of one type: a measured nominal."""
    end_with(lambda: _average(folders, output))


def _average(folders: list[Path], output: Path) -> int:
    from damageest.errors import Fault, JobError
    from damageest.io.files import check_output_file, moved_into_place
    from damageest.io.forms import FORM, average_forms, read_form, require_type, write_form
    from damageest.io.meshes import write_ply, write_stl

    writers = {".stl": write_stl, ".ply": write_ply}
    if output.suffix.lower() not in writers:
        raise JobError([Fault(f"'{output}' is neither STL nor PLY; name it with .stl or .ply")], "--output")
    form = output.with_suffix(".npz")
    for path in (output, form):
        check_output_file(path, "--output")
    forms = [read_form(folder / FORM) for folder in dict.fromkeys(folders)]
    part = _read_part(folders[0])
    require_type(forms, part)
    mean, share = average_forms(forms, part)
    mean_part = _deform(part, mean)
    with moved_into_place(output, "--output") as solid, moved_into_place(form, "--output") as field:
        writers[output.suffix.lower()](solid, mean_part)
        write_form(field, mean)
    say(f"written to {output} and {form}: the mean of {len(forms)} parts")
    if share < 1:
        say(f"note: {100 * (1 - share):.2g} % of its skin was seen on none of them, and goes on smoothly there")
    return 0


def _deform(part: Part, mean: MeasuredForm) -> Part:
    from dataclasses import replace

    from damageest.geometry.refinement import cut_part

    fine = cut_part(part, part.diagonal / FINE)
    return replace(fine, vertices=mean.field.move(fine.vertices), cad_scale=0.0)


def _read_part(folder: Path) -> Part:
    """The part as designed of the job that wrote a folder."""
    from damageest.artefacts import Part
    from damageest.errors import InputError
    from damageest.isolation import Limits
    from damageest.job import load
    from damageest.pipeline.calls import run_stage
    from damageest.registry import Registry
    from damageest.stages.part import ReadPart
    from damageest.stages.scan import ReadScan

    path = folder / "job.yaml"
    if not path.is_file():
        raise InputError(
            f"{folder}: there is no job.yaml, so this is not an output folder; name one of `damageest run`"
        )
    job = load(path, Registry.discover(), given={ReadScan: None}, without=("scan", "adapt"))
    if ReadPart not in job.stages:
        raise InputError(f"{path}: its part was an array and no file; run the job on a file")
    arguments = {"unit": job.units, "tolerance": job.tolerance}
    item = job.implementations[ReadPart]
    part = run_stage(
        job.stages[ReadPart], item, {name: arguments[name] for name in item.cls.needs()}, Limits()
    )  # fmt: skip
    assert isinstance(part, Part)
    return part
