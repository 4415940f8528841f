"""The result as files that CAM and inspection programs read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from damageest.artefacts import Floats, Scan, Solid
from damageest.handover import moved, scan_from_part
from damageest.meshio import write_ply, write_points
from damageest.stages.export import Body, Export, Writer, Written
from damageest.stages.export._options import Formats, spline_writer

if TYPE_CHECKING:
    from damageest.result import Result

UNDAMAGED, DAMAGE, DEPOSIT = (150, 155, 165), (215, 50, 40), (40, 130, 205)


class Files(Export):
    """Solids as STL, PLY, 3MF or STEP, inner damage surfaces as PLY, the scan with distance, label and site."""

    use: Literal["files"] = "files"
    format: Formats = Field(
        ("stl",),
        description="of the solids, one or a list: stl (single precision; a solid that this would open is written as "
        "ply too), ply (double precision), 3mf (one file of all, with unit, names and colours), step (faceted; plugin "
        "cadquery)",
    )
    frame: Literal["part", "scan", "both"] = Field(
        "part", description="the part's, the scan's as it was measured (files below scan_frame/), or both"
    )
    detail: float | None = Field(
        None,
        ge=0,
        description="how far facets of STEP solids may lie off the surface, so that there are fewer of them, in the "
        "job's unit; default: a tenth of the tolerance",
    )
    spline: Annotated[bool, AfterValidator(spline_writer)] = Field(
        False,
        description="each inner damage surface as B-spline in STEP too, where one fits within the tolerance (plugin "
        "cadquery)",
    )

    def run(self, result: Result, folder: Path, writers: Mapping[str, Writer]) -> Written:
        """Writes into ``folder`` and gives the paths relative to it. The same result gives the same bytes."""
        T = scan_from_part(result.pose)
        done: list[Written] = []
        if self.frame in ("part", "both"):
            done += self._frame(result, folder, "", writers, None)
        if self.frame in ("scan", "both"):
            done += self._frame(result, folder, "scan_frame/", writers, T)
        done.append(self._truth(result, folder, writers))
        return Written(tuple(f for one in done for f in one.files), tuple(n for one in done for n in one.notes))

    def _frame(
        self, result: Result, folder: Path, place: str, writers: Mapping[str, Writer], T: Floats | None
    ) -> list[Written]:
        """One frame's files, below ``place``; ``T`` takes a point of the part there."""
        lone, bodies = _bodies(result, T, result.tolerance / 10 if self.detail is None else self.detail)
        done = []
        for name in self.format:
            stems = {f"{place}result": list(bodies.values())} if writers[name].together else {}
            stems = stems or {f"{place}{stem}": [body] for stem, body in {**lone, **bodies}.items()}
            done += [_write(writers[name], folder, stem, group, result.units) for stem, group in stems.items()]
        for site in result.sites:
            path = _room(folder, f"{place}surface/site-{site.id}.ply")
            write_ply(path, moved(site.surface, T))
            done.append(Written((path.relative_to(folder).as_posix(),)))
        done.append(_scan(result, result.aligned if T is None else result.scan, folder, f"{place}scan.ply"))
        return done

    def _truth(self, result: Result, folder: Path, writers: Mapping[str, Writer]) -> Written:
        """What a virtual scanner knows, in the part's frame."""
        truth = result.scan.truth
        if truth is None:
            return Written()
        pose = {"units": result.units, "T_part_scan": truth.T_part_scan.tolist()}
        _room(folder, "truth/pose.json").write_text(json.dumps(pose, indent=1) + "\n")
        if truth.damage is None:
            return Written(("truth/pose.json",))
        body = Body("true damage", truth.damage, DAMAGE)
        name = "ply" if "ply" in self.format else "stl"
        done = _write(writers[name], folder, "truth/damage", [body], result.units)
        return Written((*done.files, "truth/pose.json"), done.notes)


def _bodies(result: Result, T: Floats | None, detail: float) -> tuple[dict[str, Body], dict[str, Body]]:
    """Stem of the file to body: the union of all damages, which a file of all has in pieces, and the others."""

    def body(name: str, stem: str, solid: Solid | None, colour: tuple[int, int, int]) -> dict[str, Body]:
        return {} if solid is None else {stem: Body(name, moved(solid, T), colour, detail)}

    several = body("damage", "damage", result.damage, DAMAGE)
    each = body("undamaged part", "undamaged", result.undamaged, UNDAMAGED)
    for site in result.sites:
        each |= body(f"damage site-{site.id}", f"damage/site-{site.id}", site.damage, DAMAGE)
        each |= body(f"deposit site-{site.id}", f"deposit/site-{site.id}", site.deposit, DEPOSIT)
    return several, each


def _write(writer: Writer, folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> Written:
    _room(folder, stem)
    return writer.write(folder, stem, bodies, unit)


def _room(folder: Path, name: str) -> Path:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    return folder / name


def _scan(result: Result, scan: Scan, folder: Path, name: str) -> Written:
    x, y, z = scan.points.T
    columns = {
        "x": x,
        "y": y,
        "z": z,
        "distance": result.deviation.distance.astype(np.float32),
        "label": result.deviation.label.astype(np.uint8),
        "site": result.site_label.astype(np.int32),
    }
    write_points(_room(folder, name), columns)
    return Written((name,))
