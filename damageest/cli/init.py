"""`damageest init`: writes a commented job file with values measured from part and scan."""

from __future__ import annotations

import json
import os
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damageest.cli._streams import say

if TYPE_CHECKING:
    from damageest.artefacts import Part, Scan
    from damageest.stages.part import CadPmi, CadTolerance

SCHEMA = "schemas/job.schema.json"


def command(
    part: Annotated[Path, typer.Argument(help="CAD file of the part: STL, PLY, OBJ, OFF, 3MF, STEP.")],
    scan: Annotated[Path, typer.Argument(help="The scan of the damaged part.")],
    job: Annotated[
        Path | None, typer.Option("--job", "-o", help="Job file to write. Default: <part>.yaml in this folder.")
    ] = None,
    units: Annotated[str, typer.Option(help="Unit of files without a unit: um, mm, cm, m, in, ft.")] = "mm",
    part_unit: Annotated[
        str, typer.Option(help="Unit of the part's numbers. Default: the file's own, or --units.")
    ] = "",
    scan_unit: Annotated[
        str, typer.Option(help="Unit of the scan's numbers. Default: the file's own, or --units.")
    ] = "",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Write a job file with values measured from part and scan."""
    from damageest.cli.part import read_pmi
    from damageest.errors import Fault, JobError
    from damageest.io.files import moved_into_place
    from damageest.job import load
    from damageest.pipeline.placing.prepare import inspect_inputs, keep_inputs
    from damageest.registry import Registry

    target = job or Path(f"{part.stem}.yaml")
    _check_target(target)
    if target.exists() and not force:
        raise JobError(
            [Fault("the file exists already; overwrite it with --force, or name another file with --job")], str(target)
        )
    own = [_check_unit(unit, name) for unit, name in ((part_unit, "--part-unit"), (scan_unit, "--scan-unit"))]
    named_part, named_scan = (_name_file(str(path), unit) for path, unit in zip((part, scan), own, strict=True))
    source = {"version": 1, "units": units, "part": named_part, "scan": named_scan}
    registry, read = Registry.discover(), dict[str, Any]()
    solid, cloud, tolerance, doubts = inspect_inputs(load(source, registry), registry, read)
    cautions = list(map(str, doubts))
    if swapped := _find_swap(part, scan, solid, cloud):
        cautions = [swapped, *cautions]
    paths = [os.path.relpath(path.resolve(), target.resolve().parent) for path in (part, scan)]
    pmi = read_pmi(named_part, units, registry)
    lines = [
        *_describe_inputs(part, scan, solid, cloud, units, cautions),
        *_write_values(paths, own, units, tolerance, pmi),
        *_write_examples(target.stem, registry.methods(), tolerance),
    ]
    with moved_into_place(target, "--job") as scratch:
        scratch.write_text("\n".join(lines) + "\n", encoding="utf-8")
    say(f"written to {target}; next: {shlex.join(['damageest', 'run', str(target)])}")
    made = load(target, registry)
    if keep_inputs(made, registry, read):
        say(f"part and scan are kept for it in {made.output / 'stages'}")
    for caution in cautions:
        say(f"caution: {caution}", err=True)
    if any(doubt.code == "unit" for doubt in doubts):
        again = ["damageest", "init", str(part), str(scan), "--job", str(target), "--force", "--scan-unit", "UNIT"]
        say(
            "caution: the tolerance was measured in these units; with the right one write the job again, do not only "
            f"change the unit in it: {shlex.join(again)} (or --part-unit, --units)",
            err=True,
        )


def _check_target(target: Path) -> None:
    """Raises JobError where the job file cannot be written, before the inputs are read. Its folder is not made: its
    paths are beside it, and a folder that is not there is most likely misspelt."""
    from damageest.errors import Fault, JobError
    from damageest.io.files import check_output_file

    check_output_file(target, "--job")
    if not target.parent.is_dir():
        remedy = f"make it ({shlex.join(['mkdir', '-p', str(target.parent)])}), or name another file"
        raise JobError([Fault(f"there is no folder {target.parent} for {target.name}; {remedy}")], "--job")


def _check_unit(name: str, option: str) -> str:
    """The short name of a unit; empty for none. Raises JobError, which names the option, for an unknown one."""
    from damageest.errors import Fault, InputError, JobError
    from damageest.geometry.units import canonical_unit

    try:
        return canonical_unit(name) if name else ""
    except InputError as error:
        raise JobError([Fault(str(error))], option) from None


def _name_file(path: str, unit: str) -> str | dict[str, str]:
    """A file as a job names it, with its unit where that is given."""
    return {"path": path, "unit": unit} if unit else path


def _describe_inputs(part: Path, scan: Path, solid: Part, cloud: Scan, units: str, cautions: list[str]) -> list[str]:
    size = " x ".join(f"{edge:.4g}" for edge in solid.bounds[1] - solid.bounds[0])
    return [
        f"# yaml-language-server: $schema={SCHEMA}",
        f"# The line above gives editors the options; write the schema with  damageest schema job > {SCHEMA}",
        f"# {part.name}: {size} {units}, {solid.volume:.5g} {units}3, {len(solid.faces)} triangles",
        f"# {scan.name}: {len(cloud.points)} points, noise {cloud.noise:.3g}, spacing {cloud.spacing:.3g} {units}",
        *(f"# note: {note}" for note in (*solid.notes, *cloud.notes)),
        *(f"# CAUTION: {caution}" for caution in cautions),
    ]


def _write_values(paths: list[str], own: list[str], units: str, tolerance: float, pmi: CadPmi) -> list[str]:
    """``own``: the units of part and scan, empty where not given."""
    said, profile = "", _choose_profile(pmi)
    if profile is not None and profile.value is not None:
        half = profile.value / 2
        if half >= tolerance:
            tolerance, said = half, f"; half of the profile tolerance '{profile.name}' of the CAD file"
        else:
            said = f"; the profile tolerance '{profile.name}' asks for {half:.4g}, which this scan is too noisy for"
    return [
        "version: 1",
        f"units: {units:<20} # of all lengths in this file, and of files without a unit",
        f"tolerance: {tolerance:<16.4g} # lambda: points closer to the nominal surface are intact; or auto{said}",
        *(
            f"{key}: " + (f"{{path: {_quote(path)}, unit: {unit}}}" if unit else _quote(path))
            for key, path, unit in zip(("part", "scan"), paths, own, strict=True)
        ),
        *_write_align(pmi, profile),
    ]


def _choose_profile(pmi: CadPmi) -> CadTolerance | None:
    """The profile tolerance with the most datums, and of those the narrowest; None where the CAD file has none."""
    profiles = [one for one in pmi.tolerances if one.kind == "surface_profile" and one.value]
    return min(profiles, key=lambda one: (-len(one.datums), one.value), default=None)


def _write_align(pmi: CadPmi, profile: CadTolerance | None) -> list[str]:
    """The alignment, by the datum system of the CAD file: that of the profile tolerance, or the one of most datums."""
    pose = "align: register             # for any start pose; icp or none if the scan is already in the part's frame"
    system = profile.datums if profile is not None else max(pmi.systems, key=len, default=())
    faces = {one.name: one.faces for one in pmi.datums}
    common = {name: [face for letter in name.split("-") for face in faces.get(letter, ())] for name in system}
    if not system or not all(common.values()):
        why = f"# the CAD file's datum system {' | '.join(system)} has datums without CAD faces: see damageest part"
        return [pose, why] if system else [pose]
    letters = [name if len(name) < 3 else name.replace("-", "")[:2] for name in system]
    return [
        "align:",
        "  use: register             # for any start pose; icp if the scan is already near the part's frame",
        "  datum:                    # of the CAD file, in the order of precedence, by the numbers of CAD faces;",
        "                            # where one of them is worn, name others, or leave datum out",
        *(f"    {letter}: {list(common[name])}" for letter, name in zip(letters, system, strict=True)),
    ]


def _write_examples(stem: str, methods: tuple[str, ...], tolerance: float) -> list[str]:
    """Lines that are comments: values that a job often changes."""
    return [
        f"# method: auto              # {' | '.join(methods)}",
        "# cluster: {use: dbscan, neighbours: 10}",
        f"# allowance: {{use: milling, outer: {2.5 * tolerance:.2g}}}  # stock to be milled off",
        "# export: {format: [stl, 3mf]}            # also ply, and step with the plugin cadquery",
        f"# output: {_quote(f'out/{stem}')}",
    ]


def _find_swap(part: Path, scan: Path, solid: Part, cloud: Scan) -> str:
    """A caution where the file of the scan looks like CAD and that of the part like a scan; empty where not.

    A CAD mesh has few triangles of very different size; a scan is dense and even.
    """
    if scan.suffix.lower() not in (".stl", ".obj", ".off", ".ply") or len(cloud.points) * 20 > len(solid.vertices):
        return ""
    return (
        f"the scan {scan.name} has {len(cloud.points)} points, the part {part.name} {len(solid.vertices)} vertices: "
        "are they swapped? The first file is the CAD model, the second the scan"
    )


def _quote(path: str) -> str:
    """The path as a YAML scalar. A JSON string is valid YAML."""
    return path if re.fullmatch(r"[\w./+-]+", path) else json.dumps(path)
