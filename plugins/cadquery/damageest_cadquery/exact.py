"""Writes solids whose outer faces are the CAD's own, as STEP; and damage volumes as CadQuery solids."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from damageest.artefacts import Deposit, DisplacementField, Floats, Mesh, Solid
from damageest.errors import InputError
from damageest.geometry.units import MILLIMETRES
from damageest.io.files import shorten_error
from damageest.isolation import Limits, ProcessError, Usage, call_isolated, find_place, tell_part
from damageest.result import Result
from damageest.stages.export import Body, ExportedFiles
from damageest_cadquery._kept import find_made
from damageest_cadquery._request import (
    ADAPTING,
    SPENT,
    WHOLE,
    Made,
    Request,
    describe_none,
    limit_form,
    name_site,
)
from damageest_cadquery._worker import make_exact, write_part
from damageest_cadquery.cutting.exact_damage import SiteInput, scale_shape
from damageest_cadquery.reading.read import read
from damageest_cadquery.solids.split import measure_volume as measure_volume  # for the evaluation
from damageest_cadquery.writing.step import OWNER

Given = TypeVar("Given")
NO_FIELD = "the part was adapted to the scan by a stage without a displacement field, so its CAD faces cannot follow"
OF_SITE = ("damage", "deposit", "milled")
LIMIT = 120.0
"""Longest time for a site, in seconds, where no job says so."""
BUDGET = 120.0
"""Processor seconds for all exact work of a run, where no job says so."""
SOLVING = 0.75
"""Share of these until which a further site is begun; the rest is for the files."""
WORKER = "damageest_cadquery exact"
SIZES, USUAL = (0.5, 5_000.0), 100.0
"""Diagonals in millimetres that a part has as a rule, and to which others are brought."""
MOST_STARTS = 12
"""How often the process is started; each time without the form or the site that stopped it before."""
MOST_FORMS = 3
"""Forms of a site that may stop it; then the site has none."""


def write_exact(
    folder: Path,
    result: Result,
    bodies: Mapping[str, Body],
    places: Mapping[str, Floats | None],
    seconds: float,
    budget: float = BUDGET,
    assembly: bool = True,
) -> ExportedFiles:
    """Writes damage volumes, what is left of the part, and an assembly of all; see `damageest.stages.export.Writer`."""
    request = replace(make_request(result, folder, bodies, places, seconds), assembly=assembly)
    if not request.sites:
        return ExportedFiles()
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as keep:
        return _write_within(replace(request, keep=keep), budget)


def _write_within(request: Request, budget: float) -> ExportedFiles:
    """Starts the process until it has done its work, each time with what it has found before, within ``budget``
    processor seconds."""
    made, spent = Made((), (), {}), 0.0
    for _ in range(MOST_STARTS):
        request = replace(request, left=budget - spent, solving=SOLVING * budget - spent)
        done, used = _run(request, make_exact)
        spent += used
        if isinstance(done, Made):
            made = done
            break
        made = find_made(request.keep)
        what, reason = done
        if what in request.skipped:
            break
        if spent >= budget:
            why = f"{SPENT}: {budget:g} s"
            request = replace(request, skipped={**request.skipped, WHOLE: why})
            made = replace(made, notes=(*made.notes, f"not all STEP solids have the CAD's faces: {why}"))
            done = made
            break
        names = [what] if what not in (WHOLE, ADAPTING) else [what, *(name_site(each.number) for each in request.sites)]
        whose = what.partition(" for ")[2]
        if whose and sum(name.endswith(f" for {whose}") for name in request.skipped) + 1 >= MOST_FORMS:
            names.append(whose)
        reason = f"{reason} with {ADAPTING}" if what == ADAPTING else reason
        request = replace(request, skipped={**request.skipped, **dict.fromkeys(names, reason)})
        if what == ADAPTING:
            break
    forms = dict(made.forms)
    for site in request.sites:
        stopped = request.skipped.get(WHOLE, "the process for exact solids stopped")
        why = request.skipped.get(name_site(site.number), stopped)
        forms.setdefault(site.number, describe_none(site, why))
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
    notes += tuple(
        f"milled/site-{number}.step has facets, not the faces of the CAD file: {form.milled.reason}"
        for number, form in sorted(forms.items())
        if form.milled is not None and form.milled.reason
    )
    if isinstance(done, Made):
        notes += made.notes
        notes += _note_missing(request, (*made.files, *made.notes))
    elif notes:
        notes += ("damage.step and undamaged.step have facets too",)
    return ExportedFiles(made.files, notes, exact=dict(sorted(forms.items())), warnings=notes)


def _note_missing(request: Request, said: Sequence[str]) -> tuple[str, ...]:
    """Notes on assemblies that were not written, and of which nothing was said: no facets stand in for them."""
    names = [f"{place}result.step" for place in request.places] if request.assembly and request.bodies else []
    return tuple(f"{name} was not written: {SPENT}" for name in names if not any(name in text for text in said))


def make_request(
    result: Result, folder: Path, bodies: Mapping[str, Body], places: Mapping[str, Floats | None], seconds: float
) -> Request:
    """What the process gets: everything in millimetres, or these times a power of two where the part is very small or
    large: OpenCASCADE takes all that is nearer than 1e-7 for one, whatever the size."""
    unit = MILLIMETRES[result.units]
    enlarged = find_enlargement(result.part.diagonal * unit)
    factor = unit * enlarged
    part = replace(
        _scale(result.part, factor), tessellation_error=result.part.tessellation_error * factor, unit="mm", notes=()
    )
    moved = {place: None if T is None else _scale_shift(T, unit) for place, T in places.items()}
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
        seconds=seconds,
        field=_scale_field(result, factor),
        enlarged=enlarged,
    )


def find_enlargement(diagonal: float) -> float:
    """The power of two that brings the diagonal of a part, in millimetres, near to `USUAL`; 1 where it is within
    `SIZES`. By a power of two no coordinate is rounded."""
    if SIZES[0] <= diagonal <= SIZES[1]:
        return 1.0
    return float(2.0 ** round(math.log2(USUAL / diagonal)))


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
    cavity, milled, opening = (
        None if body is None else _scale(body, factor) for body in (scaled.cavity, scaled.milled, scaled.opening)
    )
    return replace(
        scaled, cavity=cavity, milled=milled, opening=opening, heights=heights, stock_volume=volume, overlap=overlap
    )


def _scale(mesh: Any, factor: float) -> Any:
    assert isinstance(mesh, Mesh)
    return mesh if factor == 1 else replace(mesh, vertices=np.asarray(mesh.vertices) * factor)


def _scale_field(result: Result, factor: float) -> DisplacementField | None:
    field = None if result.adapted is None else result.adapted.field
    if field is None or factor == 1:
        return field
    return DisplacementField(field.low * factor, field.high * factor, field.controls * factor)


def _limit(request: Request) -> Limits:
    """Of the process as a whole: its own looks at the clock come before that, unless OpenCASCADE does not return."""
    return Limits(seconds=request.left if math.isfinite(request.left) else 0)


def _scale_shift(T: Floats, factor: float) -> Floats:
    moved = np.array(T)
    moved[:3, 3] *= factor
    return moved


def _run(request: Request, work: Callable[..., Given], **more: str) -> tuple[Given | tuple[str, str], float]:
    """Starts the process once. Gives what it made, or what it was doing where it stopped and why; and the processor
    seconds that it took."""
    used: list[float] = []
    done = _start(request, work, lambda usage: used.append(usage.seconds), **more)
    return done, sum(used)


def _start(
    request: Request, work: Callable[..., Given], tell: Callable[[Usage], None], **more: str
) -> Given | tuple[str, str]:
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as place:
        arguments = {"request": replace(request, scratch=place), **more}
        try:
            return call_isolated(
                work, arguments, worker=WORKER, owner=OWNER, limits=_limit(request), show=False, stays=False,
                processor_time=True, tell=tell, watch=lambda what: tell_part(f"exact STEP: {what}"),
            )  # fmt: skip
        except ProcessError as error:
            what = find_place(error) or WHOLE
            allowed = limit_form(request.seconds) if " for " in what else request.seconds
            late = f"OpenCASCADE took longer than {min(allowed, request.left):g} s"
            return what, late if error.why == "time" else f"OpenCASCADE stopped ({error.message})"
        except Exception as error:  # OpenCASCADE's exceptions share no base of their own
            return find_place(error) or WHOLE, f"OpenCASCADE stopped ({type(error).__name__}: {shorten_error(error)})"


def as_cadquery(result: Result, what: str, site: int | None = None) -> Any:
    """A ``cadquery.Shape`` with the CAD's own faces, in the part's frame and the result's unit.

    ``what``: part, undamaged, or damage, deposit or milled of a ``site``; where no allowance adds to it, the deposit is
    the damage volume. It is made in a process of its own, as for files. Raises
    ValueError for another name or site, InputError where the part has no CAD faces or no exact form passes the checks.
    """
    if what not in ("part", "undamaged", *OF_SITE):
        raise ValueError(f"no '{what}' as CadQuery; there are: part, undamaged, {', '.join(OF_SITE)}")
    known = {each.id: each for each in result.sites}
    if what in OF_SITE and site not in known:
        raise ValueError(f"there is no site {site}; there are: {', '.join(map(str, known)) or 'none'}")
    if what in ("deposit", "milled") and site is not None:
        known[site].mesh("deposit")  # raises where it was refused
        what = "damage" if what == "deposit" and known[site].deposit is None else what
    if not result.part.cad_scale:
        raise InputError("the part is a mesh: only a part from STEP, IGES or BREP has CAD faces")
    if result.adapted is not None and result.adapted.field is None:
        raise InputError(f"{NO_FIELD}; take as_trimesh, or a stage adapt that gives a field, for example adapt: smooth")
    if what == "part" or (what == "undamaged" and not result.sites):
        if result.adapted is None:
            return _take_shape(Path(result.part.path), result.part.cad_scale)
        return _take_adapted(result)
    chosen = result if what == "undamaged" else replace(result, sites=tuple(s for s in result.sites if s.id == site))
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as place:
        bodies = {}
        for each in chosen.sites:
            stem = f"damage/site-{each.id}" if each.accepted else f"doubtful/site-{each.id}"
            bodies[stem] = Body(stem, each.damage, (0, 0, 0))
            if each.deposit is not None:
                bodies[f"deposit/site-{each.id}"] = Body("deposit", each.deposit, (0, 0, 0))
            if isinstance(each.deposit, Deposit) and each.deposit.milled is not None:
                bodies[f"milled/site-{each.id}"] = Body("to be milled", each.deposit.milled, (0, 0, 0))
        if result.undamaged is not None and result.damage is not None:
            bodies["undamaged"] = Body("undamaged", result.undamaged, (0, 0, 0))
            bodies["damage"] = Body("damage", result.damage, (0, 0, 0))
        done = write_exact(Path(place), chosen, bodies, {"": None}, LIMIT, LIMIT, assembly=False)
        folders = {"damage": ("damage/", "doubtful/"), "undamaged": ("undamaged.step",)}
        folders |= {name: (f"{name}/",) for name in ("deposit", "milled")}
        wanted = [name for name in done.files if name.startswith(folders[what])]
        if not wanted:
            raise InputError(f"{what} has no exact form; take as_trimesh ({'; '.join(done.notes)})")
        return _take_shape(Path(place) / wanted[0], 1 / MILLIMETRES[result.units])


def _take_adapted(result: Result) -> Any:
    """The adapted part. Raises InputError where the faces of its CAD file cannot follow it."""
    with tempfile.TemporaryDirectory(prefix="damageest-exact-") as place:
        file = Path(place) / "part.brep"
        done, _ = _run(make_request(result, Path(place), {}, {}, LIMIT), write_part, file=str(file))
        why = done if isinstance(done, str) else done[1]
        if why:
            raise InputError(f"the adapted part has no exact form: {why}; take as_trimesh")
        return _take_shape(file, 1 / MILLIMETRES[result.units])


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
