"""Writes solids whose outer faces are the CAD's own, as STEP; and damage volumes as CadQuery solids."""

from __future__ import annotations

import json
import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Deposit, Floats, Mesh, Solid
from damageest.errors import InputError
from damageest.geometry.units import MILLIMETRES
from damageest.isolation import ONE_THREAD
from damageest.result import Result
from damageest.stages.export import Body, DepositForm, ExactForm, ExportedFiles
from damageest_cadquery._exact import SiteInput, scale_shape
from damageest_cadquery._read import read
from damageest_cadquery._request import Request, describe_missing
from damageest_cadquery._split import measure_volume as measure_volume  # for the evaluation

LIMIT = 120.0
"""Longest time for a site, in seconds, where no job says so."""
WAIT = 20.0
"""Longest time by the clock on the wall, in limits, for a process that uses no processor."""
MOST_STARTS = 8
"""How often the process is started; each time without the site that stopped it before."""


def write_exact(
    folder: Path,
    result: Result,
    bodies: Mapping[str, Body],
    places: Mapping[str, Floats | None],
    seconds: float,
) -> ExportedFiles:
    """Writes damage volumes, what is left of the part, and an assembly of all; see `damageest.stages.export.Writer`."""
    request = make_request(result, folder, bodies, places)
    if not request.sites:
        return ExportedFiles()
    said: dict[str, Any] = {}
    for _ in range(MOST_STARTS):
        said, at, reason = _run(request, seconds)
        if said:
            break
        if at.file in request.left_out or (not at.file and at.site in request.skipped):
            break
        if at.file:
            request = replace(request, left_out={**request.left_out, at.file: reason})
        elif at.site:
            request = replace(request, skipped={**request.skipped, at.site: reason})
        else:
            request = replace(request, skipped={each.number: reason for each in request.sites})
    forms = {int(number): _read_form(form) for number, form in said.get("forms", {}).items()}
    for site_input in request.sites:
        why = (request.skipped.get(site_input.number, "the process for exact solids stopped"),)
        forms.setdefault(site_input.number, ExactForm("none", tried=why, deposit=describe_missing(site_input)))
    notes = tuple(
        f"site-{number}.step has facets, not the faces of the CAD file: {form.tried[-1] if form.tried else 'unknown'}"
        for number, form in sorted(forms.items())
        if form.form == "none"
    )
    notes += tuple(
        f"deposit/site-{number}.step has facets, not offsets of the CAD's faces: {form.deposit.reason}"
        for number, form in sorted(forms.items())
        if form.deposit is not None and form.deposit.reason
    )
    notes += tuple(said.get("notes", () if not notes else ("damage.step and undamaged.step have facets too",)))
    files = tuple(said.get("files", ()))
    return ExportedFiles(files, notes, exact=dict(sorted(forms.items())), warnings=notes)


def make_request(
    result: Result, folder: Path, bodies: Mapping[str, Body], places: Mapping[str, Floats | None]
) -> Request:
    """What the process gets: everything in millimetres."""
    factor = MILLIMETRES[result.units]
    part = replace(
        _scale(result.part, factor), tessellation_error=result.part.tessellation_error * factor, unit="mm", notes=()
    )
    moved = {place: None if T is None else _scale_shift(T, factor) for place, T in places.items()}
    return Request(
        part=part,
        scale=result.part.cad_scale * factor,
        tolerance=result.tolerance * factor,
        unit=result.units,
        sites=tuple(_take_site(result, number, factor) for number in range(len(result.sites))),
        bodies={stem: replace(body, solid=_scale(body.solid, factor)) for stem, body in bodies.items()},
        folder=str(folder),
        scratch="",
        places=moved,
        skipped={},
    )


def _take_site(result: Result, index: int, factor: float) -> SiteInput:
    site = result.sites[index]
    return SiteInput(
        number=site.id,
        damage=_scale(site.damage, factor),
        surface=_scale(site.surface, factor),
        enclosures=tuple(_scale(solid, factor) for solid in site.enclosures),
        points=np.asarray(result.aligned.points[site.points]) * factor,
        accepted=site.accepted,
        deposit=None if site.deposit is None else _scale_deposit(site.deposit, factor),
    )


def _scale_deposit(deposit: Solid, factor: float) -> Solid:
    scaled: Solid = _scale(deposit, factor)
    if not isinstance(scaled, Deposit):
        return scaled
    heights = tuple((number, height * factor if height > 0 else height) for number, height in scaled.heights)
    volume, overlap = scaled.stock_volume * factor**3, scaled.overlap * factor
    return replace(scaled, cavity=None, heights=heights, stock_volume=volume, overlap=overlap)


def _scale(mesh: Any, factor: float) -> Any:
    assert isinstance(mesh, Mesh)
    return mesh if factor == 1 else replace(mesh, vertices=np.asarray(mesh.vertices) * factor)


def _scale_shift(T: Floats, factor: float) -> Floats:
    moved = np.array(T)
    moved[:3, 3] *= factor
    return moved


def _read_form(values: dict[str, Any]) -> ExactForm:
    deposit = None if values["deposit"] is None else DepositForm(**values["deposit"])
    return ExactForm(**{**values, "tried": tuple(values["tried"]), "deposit": deposit})


@dataclass(frozen=True)
class _Place:
    """Where the process was: the number of a site, the negative of it for its deposit, or the stem of a ``file``."""

    site: int = 0
    file: str = ""


def _run(request: Request, seconds: float) -> tuple[dict[str, Any], _Place, str]:
    """Starts the process once. Gives what it said at its end; or where it stopped, and why."""
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as place:
        path = Path(place) / "request.pkl"
        path.write_bytes(pickle.dumps(replace(request, scratch=place)))
        leash, held = os.pipe()
        try:
            process = subprocess.Popen(
                [sys.executable, "-m", "damageest_cadquery._worker", str(path), str(leash)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                pass_fds=(leash,),
                start_new_session=True,  # Ctrl-C reaches this process alone, with which the other one ends
                env={**os.environ, **ONE_THREAD, "PYTHONWARNINGS": "ignore"},
            )
            try:
                return _follow(process, seconds)
            finally:
                process.kill()
                process.wait()
        finally:
            os.close(leash)
            os.close(held)


def _follow(process: subprocess.Popen[str], seconds: float) -> tuple[dict[str, Any], _Place, str]:
    lines: queue.Queue[str | None] = queue.Queue()
    errors: list[str] = []

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)
        lines.put(None)

    def listen_to_errors() -> None:
        assert process.stderr is not None
        errors.extend(process.stderr)

    threads = [threading.Thread(target=each, daemon=True) for each in (listen, listen_to_errors)]
    for thread in threads:
        thread.start()
    at, clock = _Place(), _Clock(process.pid)
    while True:
        try:
            line = lines.get(timeout=min(seconds, 0.5))
        except queue.Empty:
            if clock.has_passed(seconds):
                return {}, at, f"OpenCASCADE took longer than {seconds:g} s"
            continue
        clock = _Clock(process.pid)
        if line is None:
            process.wait()
            threads[1].join(timeout=5)
            last = errors[-1].strip()[:200] if errors else f"exit status {process.returncode}"
            return {}, at, f"OpenCASCADE stopped ({last})"
        if not line.startswith("{"):
            continue
        said = json.loads(line)
        if "forms" in said:
            return said, at, ""
        if "start" in said:
            at = _Place(said["start"], said.get("file", ""))


class _Clock:
    """Time since it was made: of the processor where the system tells it, since a busy machine is no reason to stop."""

    def __init__(self, process: int) -> None:
        self.process = process
        self.wall, self.used = time.monotonic(), self._measure()

    def _measure(self) -> float | None:
        try:
            fields = Path(f"/proc/{self.process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return None
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def has_passed(self, seconds: float) -> bool:
        wall, used = time.monotonic() - self.wall, self._measure()
        if used is None or self.used is None:
            return wall > seconds
        return used - self.used > seconds or wall > WAIT * seconds


def as_cadquery(result: Result, what: str, site: int | None = None) -> Any:
    """A ``cadquery.Shape`` with the CAD's own faces, in the part's frame and the result's unit.

    ``what``: part, undamaged, or damage or deposit of a ``site``; where no allowance adds to it, the deposit is the
    damage volume. It is made in a process of its own, as for files. Raises
    ValueError for another name or site, InputError where the part has no CAD faces or no exact form passes the checks.
    """
    if what not in ("part", "undamaged", "damage", "deposit"):
        raise ValueError(f"no '{what}' as CadQuery; there are: part, undamaged, damage, deposit")
    known = {each.id: each for each in result.sites}
    if what in ("damage", "deposit") and site not in known:
        raise ValueError(f"there is no site {site}; there are: {', '.join(map(str, known)) or 'none'}")
    if what == "deposit" and site is not None:
        known[site].mesh("deposit")  # raises where it was refused
        what = "damage" if known[site].deposit is None else what
    if not result.part.cad_scale:
        raise InputError("the part is a mesh: only a part from STEP, IGES or BREP has CAD faces")
    if what == "part" or (what == "undamaged" and not result.sites):
        return _take_shape(Path(result.part.path), result.part.cad_scale)
    chosen = result if what == "undamaged" else replace(result, sites=tuple(s for s in result.sites if s.id == site))
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as place:
        bodies = {}
        for each in chosen.sites:
            stem = f"damage/site-{each.id}" if each.accepted else f"doubtful/site-{each.id}"
            bodies[stem] = Body(stem, each.damage, (0, 0, 0))
            if each.deposit is not None:
                bodies[f"deposit/site-{each.id}"] = Body("deposit", each.deposit, (0, 0, 0))
        if result.undamaged is not None and result.damage is not None:
            bodies["undamaged"] = Body("undamaged", result.undamaged, (0, 0, 0))
            bodies["damage"] = Body("damage", result.damage, (0, 0, 0))
        done = write_exact(Path(place), chosen, bodies, {"": None}, LIMIT)
        folders = {"damage": ("damage/", "doubtful/"), "deposit": ("deposit/",), "undamaged": ("undamaged.step",)}
        wanted = [name for name in done.files if name.startswith(folders[what])]
        if not wanted:
            raise InputError(f"{what} has no exact form; take as_trimesh ({'; '.join(done.notes)})")
        return _take_shape(Path(place) / wanted[0], 1 / MILLIMETRES[result.units])


def _take_shape(path: Path, scale: float) -> Any:
    import cadquery
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    solids = [scale_shape(solid, scale) for solid in read(path, path.suffix.lower()).solids]
    if len(solids) == 1:
        return cadquery.Shape.cast(solids[0])
    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for solid in solids:
        builder.Add(whole, solid)
    return cadquery.Shape.cast(whole)
