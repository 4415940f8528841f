"""Writes the result as files for CAM and inspection programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field

from damageest.artefacts import Deposit, Floats, Solid
from damageest.geometry.simplification import simplify_within
from damageest.geometry.touching import ROUNDS, separate_touching
from damageest.geometry.transforms import move_mesh, move_points
from damageest.io.meshes import write_ply
from damageest.stages import JobPath
from damageest.stages.export import Body, Export, ExportedFiles, Patch, PathSettings, PathWriter, Writer
from damageest.stages.export._colours import DAMAGE, DEPOSIT, DOUBTFUL, MILLED, SURPLUS, UNDAMAGED
from damageest.stages.export._coverage import write_coverage
from damageest.stages.export._nominal import map_to_nominal
from damageest.stages.export._options import Formats, MachineFile, PathFormats, PathOption, check_spline_writer
from damageest.stages.export._path_checks import check_paths
from damageest.stages.export._paths import write_paths
from damageest.stages.export._scan_points import PointColours, write_scan

if TYPE_CHECKING:
    from damageest.result import Result

SCAN, NOMINAL = "scan_frame/", "nominal_frame/"
"""Folders of the files in the scan's frame, and of those on the part as designed."""
PLACES = {"part": ("",), "scan": (SCAN,), "both": ("", SCAN), "nominal": (NOMINAL,), "all": ("", SCAN, NOMINAL)}
"""Folders by the frame that is asked for."""
FEW = 20_000
"""Triangles of a solid of several sites up to which its sheets are moved apart where they touch."""


class Files(Export):
    """Writes solids as STL, PLY, 3MF or STEP; inner damage surfaces and the labelled scan as PLY."""

    use: Literal["files"] = "files"
    format: Formats = Field(
        ("stl",),
        description="format of the solids, one or a list: stl (single precision; a solid that rounding opens is "
        "written as ply too), ply (double precision), 3mf (one file for all, with unit, names and colours), step "
        "(plugin cadquery), qif (plugin qif: a QIF 3.0 document of the result)",
    )
    solids: Literal["auto", "exact", "faceted"] = Field(
        "auto",
        description="faces of STEP solids: exact (outer faces are the part's own CAD faces, for a part from STEP, IGES "
        "or BREP), faceted, or auto (exact where the part has CAD faces)",
    )
    limit: float = Field(
        60.0,
        gt=0,
        le=3600,
        description="longest time for the exact form of a site, in seconds of the processor; then it gets facets",
    )
    exact_seconds: float = Field(
        120.0,
        gt=0,
        le=36_000,
        description="longest time for all exact forms of a run, in seconds of the processor; sites that it does not "
        "reach get facets",
    )
    frame: Literal["part", "scan", "both", "nominal", "all"] = Field(
        "part",
        description="frame of the files: part (adapted, where it was), scan (as measured, in scan_frame/), both, "
        "nominal (in nominal_frame/: an adapted part moved back to the design), or all three",
    )
    detail: float | None = Field(
        None,
        ge=0,
        description="largest distance by which facets of STEP solids may deviate, to make fewer of them, in the job's "
        "unit; default: a quarter of the tolerance",
    )
    point_colours: PointColours = Field(
        "label",
        description="red, green and blue in scan.ply: by label (the colours of the scan are scan_red, scan_green, "
        "scan_blue), or those of the scan, where it has some",
    )
    spline: Annotated[bool, AfterValidator(check_spline_writer)] = Field(
        False,
        description="write each inner damage surface as B-spline in STEP too, where one fits within the tolerance "
        "(plugin cadquery)",
    )

    paths: PathFormats = Field(
        ("csv", "apt", "rs274"),
        description="formats of deposition paths, where the job plans them: csv, apt (CLDATA), rs274 (G-code); for a "
        "machine, with the plugin machines: krl, rapid, fanuc, sinumerik, heidenhain, linuxcnc, json",
    )
    machine: MachineFile | None = Field(
        None,
        description="file that defines the machine of the paths, with its suffix, or the name of one that the plugin "
        "machines brings (damageest machine list)",
    )
    path_header: JobPath | None = Field(
        None, description="file with the first lines of G-code, in which $title, $units, $offset and $site are replaced"
    )
    path_footer: JobPath | None = Field(None, description="file with the last lines of G-code, like path_header")
    path_options: Mapping[str, PathOption] = Field(
        {},
        description="for the writers of paths; rs274: on, off (default M3, M5), power (the S word), work_offset (G54), "
        "rotary (AC, BC, none, auto), tcp (control, machine, table), tcpm_on, tcpm_off (G43.4 H1, G49), pivot",
    )

    def find_faults(self, job: Mapping[str, Any], registry: Any) -> list[tuple[tuple[str | int, ...], str]]:
        """What the writers of paths cannot do, where the job plans some or names a machine."""
        settings = PathSettings("mm", "check", options=self.path_options, machine=self.machine)
        templates = {"path_header": self.path_header, "path_footer": self.path_footer}
        return check_paths(self.paths, settings, templates, job.get("path"), registry.path_writers)

    def find_reach(self, path_writers: Mapping[str, PathWriter]) -> Floats | None:
        """That of the first format of the paths that knows its machine, where paths are in the part's frame alone."""
        if self.machine is None or any(place == SCAN for place in PLACES[self.frame]):
            return None
        told = PathSettings("mm", "", options=self.path_options, machine=self.machine)
        known = [path_writers[name].reach for name in self.paths if name in path_writers]
        return next((reach(told) for reach in known if reach is not None), None)

    def run(
        self,
        result: Result,
        folder: Path,
        writers: Mapping[str, Writer],
        path_writers: Mapping[str, PathWriter] = MappingProxyType({}),
    ) -> ExportedFiles:
        """Writes into ``folder``; gives the paths relative to it. The same result gives the same bytes."""
        splines = {}
        if self.spline:
            from damageest.stages.export._spline import fit_spline

            splines = {site.id: fit_spline(site.surface, result.tolerance) for site in result.sites}
        places = {place: result.transform_to_scan if place == SCAN else None for place in PLACES[self.frame]}
        bodies = _collect_bodies(result)
        back = map_to_nominal(result, bodies) if NOMINAL in places and result.adapted else None
        done: list[ExportedFiles] = []
        ready = ExportedFiles()
        here = {place: T for place, T in places.items() if not (back and place == NOMINAL)}
        if here:
            shapes = self._prepare(bodies, result, writers)
            ready = self._write_exact(result, folder, writers, shapes["simplify"], here)
            done.append(ready)
        for place, T in here.items():
            done += self._write_shapes(result, shapes, folder, place, T, writers, ready.files)
            head, foot = _read_text(self.path_header), _read_text(self.path_footer)
            told = PathSettings(result.units, "", head, foot, self.path_options, machine=self.machine)
            done.append(write_paths(result, folder, place, T, self.paths, path_writers, told))
            if splines:
                patches = {number: patch for number, (patch, _) in splines.items() if patch}
                done += _write_patches(writers, folder, place, patches, T, result.units)
        if back:
            shapes = self._prepare(back.bodies, result, writers)
            done += self._write_shapes(back.result, shapes, folder, NOMINAL, None, writers, ())
            done.append(back.tell(bool(splines), any(writers[name].exact for name in self.format)))
        done.append(self._write_truth(result, folder, writers))
        done += [document(folder, result) for name in self.format if (document := writers[name].document)]
        files = dict.fromkeys(f for one in done for f in one.files)  # the writer of STL may have written a PLY already
        notes = tuple(n for one in done for n in one.notes)
        fits = {number: spline for number, (_, spline) in splines.items()}
        warnings = tuple(n for one in done for n in one.warnings)
        return ExportedFiles(tuple(files), notes, fits, ready.exact, warnings)

    def _prepare(
        self, bodies: Mapping[str, Body], result: Result, writers: Mapping[str, Writer]
    ) -> dict[str, Mapping[str, Body]]:
        """The bodies, by the stems of their files: ``all`` as they are; for formats that ``simplify``; and for those in
        ``single`` precision."""
        detail = result.tolerance / 4 if self.detail is None else self.detail
        coarse = {}
        if detail and any(writers[name].simplify for name in self.format):
            coarse = {stem: replace(body, solid=simplify_within(body.solid, detail)) for stem, body in bodies.items()}
        rounded = {}
        if any(writers[name].single for name in self.format):
            rounded = {
                stem: replace(body, solid=_keep_closed(body.solid, result, "/" in stem or len(body.solid.faces) <= FEW))
                for stem, body in bodies.items()
            }
        return {"all": bodies, "simplify": coarse or bodies, "single": rounded}

    def _write_shapes(
        self,
        result: Result,
        shapes: Mapping[str, Mapping[str, Body]],
        folder: Path,
        place: str,
        T: Floats | None,
        writers: Mapping[str, Writer],
        ready: Sequence[str],
    ) -> list[ExportedFiles]:
        """Writes solids, surfaces and scan below ``place``, but for the solids that are ``ready``; ``shapes``: as
        `_prepare` gives them."""
        done = []
        for name in self.format:
            if writers[name].document:
                continue
            kind = "simplify" if writers[name].simplify else "single" if writers[name].single else "all"
            left = {stem: body for stem, body in shapes[kind].items() if f"{place}{stem}.{name}" not in ready}
            done += _write_solids(writers[name], folder, place, left, T, result.units)
        return done + self._write_surfaces(result, folder, place, T)

    def _write_exact(
        self,
        result: Result,
        folder: Path,
        writers: Mapping[str, Writer],
        bodies: Mapping[str, Body],
        places: Mapping[str, Floats | None],
    ) -> ExportedFiles:
        """Writes solids with the CAD's own faces, in the first format that can hold them; nothing where the part has
        none."""
        writer = next((writers[name].exact for name in self.format if writers[name].exact), None)
        if self.solids == "faceted" or writer is None:
            return ExportedFiles()
        if not result.part.cad_scale:
            if self.solids == "auto":
                return ExportedFiles()
            note = (
                "solids: exact needs CAD faces: the part is a mesh, so STEP solids have facets; give the part as STEP"
            )
            return ExportedFiles(notes=(note,), warnings=(note,))
        if result.adapted is not None and result.adapted.field is None:
            note = (
                "STEP solids have facets, not the faces of the CAD file: the part was adapted to the scan by a stage "
                "without a displacement field; take adapt: smooth, or adapt: none"
            )
            return ExportedFiles(notes=(note,), warnings=(note,))
        return writer(folder, result, bodies, places, self.limit, self.exact_seconds)

    def _write_surfaces(self, result: Result, folder: Path, place: str, T: Floats | None) -> list[ExportedFiles]:
        """Writes surfaces and scan below ``place``; ``T`` (4,4) takes a point from the part's frame to theirs."""
        done = []
        for site in result.sites:
            group = "surface" if site.accepted else "doubtful/surface"
            path = _make_folder(folder, f"{place}{group}/site-{site.id}.ply")
            write_ply(path, move_mesh(site.surface, T))
            done.append(ExportedFiles((path.relative_to(folder).as_posix(),)))
        scan = result.aligned if T is None else replace(result.scan, points=result.raw_points)
        done.append(write_scan(result, scan, folder, f"{place}scan.ply", self.point_colours))
        if result.coverage is not None:
            done.append(write_coverage(result.coverage, T, folder, place))
        return done

    def _write_truth(self, result: Result, folder: Path, writers: Mapping[str, Writer]) -> ExportedFiles:
        """Writes the true damage and pose of a virtual scan, in the part's frame."""
        truth = result.scan.truth
        if truth is None:
            return ExportedFiles()
        pose = {"units": result.units, "T_part_scan": truth.T_part_scan.tolist()}
        _make_folder(folder, "truth/pose.json").write_text(json.dumps(pose, indent=1) + "\n", encoding="utf-8")
        if truth.damage is None:
            return ExportedFiles(("truth/pose.json",))
        lost = truth.damage
        if result.adapted is not None and truth.deformed is not None:  # where it lies in the adapted part
            lost = move_mesh(truth.deformed, result.pose.T_part_scan @ np.linalg.inv(truth.T_part_scan))
        body = Body("true damage", lost, DAMAGE)
        name = "ply" if "ply" in self.format else "stl"
        done = _write(writers[name], folder, "truth/damage", [body], result.units)
        return ExportedFiles((*done.files, "truth/pose.json"), done.notes)


def _read_text(path: Path | None) -> str | None:
    return None if path is None else path.read_text(encoding="utf-8")


def _collect_bodies(result: Result) -> dict[str, Body]:
    """All bodies in the part's frame, by the stems of their files."""
    found: list[tuple[str, str, Solid | None, tuple[int, int, int]]] = [
        ("damage", "damage", result.damage, DAMAGE),
        ("undamaged", "undamaged part", result.undamaged, UNDAMAGED),
    ]
    for site in result.sites:
        if not site.accepted:
            found.append((f"doubtful/site-{site.id}", f"doubtful site-{site.id}", site.damage, DOUBTFUL))
            continue
        found.append((f"damage/site-{site.id}", f"damage site-{site.id}", site.damage, DAMAGE))
        found.append((f"deposit/site-{site.id}", f"deposit site-{site.id}", site.deposit, DEPOSIT))
        if isinstance(site.deposit, Deposit):
            found.append((f"milled/site-{site.id}", f"to be milled site-{site.id}", site.deposit.milled, MILLED))
    for item in result.surplus:
        found.append((f"surplus/site-{item.id}", f"surplus site-{item.id}", item.solid, SURPLUS))
    return {stem: Body(name, solid, colour) for stem, name, solid, colour in found if solid is not None}


def _keep_closed(solid: Solid, result: Result, moving: bool = True) -> Solid:
    """The solid, closed when single precision merges vertices in any of the two frames, with the same triangles.

    ``moving``: whether sheets that touch are moved apart. Neighbouring sites in one large solid touch on whole faces,
    which takes long.
    """
    moved = move_mesh(solid, result.transform_to_scan)
    largest = max(float(np.abs(each.bounds).max()) for each in (solid, moved))
    radius = 2 * float(np.spacing(np.float32(largest)))
    return separate_touching(solid, radius, 10 * radius, ROUNDS if moving else 1) or solid


def _write_solids(
    writer: Writer, folder: Path, place: str, bodies: Mapping[str, Body], T: Floats | None, unit: str
) -> list[ExportedFiles]:
    """Writes one file for each body; or one of all bodies but the union of the damage volumes, and one of what is
    doubtful."""
    here = {stem: replace(body, solid=move_mesh(body.solid, T)) for stem, body in bodies.items()}
    if writer.one_file:
        doubtful = [body for stem, body in here.items() if stem.startswith("doubtful/")]
        pieces = [body for stem, body in here.items() if stem != "damage" and not stem.startswith("doubtful/")]
        done = [_write(writer, folder, f"{place}result", pieces, unit)]
        # apart from the others: what is doubtful is not to reach the machine unasked
        return done + ([_write(writer, folder, f"{place}doubtful/result", doubtful, unit)] if doubtful else [])
    return [_write(writer, folder, f"{place}{stem}", [body], unit) for stem, body in here.items()]


def _write_patches(
    writers: Mapping[str, Writer], folder: Path, place: str, patches: Mapping[int, Patch], T: Floats | None, unit: str
) -> list[ExportedFiles]:
    """Writes the splines of the sites in the first format that can hold them."""
    suffix, write = next((name, writer.patch) for name, writer in sorted(writers.items()) if writer.patch)
    done = []
    for number, patch in patches.items():
        name = f"{place}surface/site-{number}.{suffix}"
        here = patch if T is None else replace(patch, poles=move_points(patch.poles, T))
        path = _make_folder(folder, name)
        said = write(path, f"damage surface site-{number}", here, unit)
        notes = (f"{name} {said}",) if said else ()
        done.append(ExportedFiles((name,) if path.is_file() else (), notes, warnings=notes))
    return done


def _write(writer: Writer, folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    _make_folder(folder, stem)
    return writer.write(folder, stem, bodies, unit)


def _make_folder(folder: Path, name: str) -> Path:
    """The path of a file ``name`` in ``folder``, with its parent folders made."""
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    return folder / name
