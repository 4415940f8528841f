"""Finds the exact forms of all sites and writes them, in a process of its own: OpenCASCADE can crash or hang."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from damageest.artefacts import Deposit, Part
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.skin import find_inner_faces
from damageest.isolation import at_work
from damageest.stages.export import DepositForm, ExactForm
from damageest_cadquery._adapted import MovedSolids, move_solids
from damageest_cadquery._claims import lower_claims
from damageest_cadquery._colours import read_colours
from damageest_cadquery._crossed import find_crossed
from damageest_cadquery._deposit import STOCK, ExactDeposit, find_deposit, refuse_doubles
from damageest_cadquery._exact import Exact, SiteInput, find_exact, scale_shape, start_solids
from damageest_cadquery._files import join_shapes
from damageest_cadquery._moved import MoveError
from damageest_cadquery._output import Writing, write_all
from damageest_cadquery._read import Model, explore, read
from damageest_cadquery._request import (
    ADAPTING,
    WHOLE,
    CadFacts,
    Made,
    Request,
    describe_missing,
    limit_form,
    name_crossed,
    name_deposit,
    name_form,
    name_site,
)
from damageest_cadquery._solids import StockError, list_faces

CLAIMS = 0.01
"""Largest tolerance of an edge, in tolerances of the job, that is taken as the CAD file claims it."""


def make_exact(request: Request) -> Made:
    """Finds the exact forms and writes the files. It notes what is at work, so that where it stops, it can be started
    again without that."""
    with at_work(WHOLE, request.seconds):
        return _make(request)


def _make(request: Request) -> Made:
    part = request.part
    model = read(Path(part.path), Path(part.path).suffix.lower())
    try:
        cad = take_solids(model, request)
    except MoveError as error:
        why = f"the faces of the CAD file could not be adapted: {error}"
        none = {site.number: ExactForm("none", tried=(why,), deposit=describe_missing(site)) for site in request.sites}
        return Made((), ("damage.step and undamaged.step have facets too",), none)
    solids, faces = start_solids(cad.solids)
    originals = [face for solid in model.solids for face in _explore_faces(solid)]
    facts = CadFacts(
        [model.name_of(face) or f"face {number}" for number, face in enumerate(originals)],
        read_colours(Path(part.path), len(originals)),
        model.solid_names,
    )
    rest, found = solids, {}
    deposits: dict[int, ExactDeposit] = {}
    reasons: dict[int, tuple[str, ...]] = {}
    forms: dict[int, DepositForm | None] = {}
    for site in request.sites:
        forms[site.number] = describe_missing(site)
        if fault := request.skipped.get(name_site(site.number)):
            reasons[site.number] = (fault,)
            continue
        with at_work(name_site(site.number), request.seconds):
            around = rest if site.accepted else solids
            exact, reasons[site.number] = find_exact(
                site, around, faces, part, request.tolerance, cad.off, partial(_watch, request, site), request.seconds
            )
        if exact is None:
            *before, last = reasons[site.number]
            with at_work(name_crossed(site.number), request.seconds):
                skipped = name_crossed(site.number) in request.skipped
                crossed = [] if skipped else find_crossed(solids, faces, site.damage, request.tolerance)
            told = f"{last}; it lies on {_tell_faces(site, part, facts.names)}"
            if crossed:
                told += f"; in the CAD file these cross one another: {list_faces(crossed, facts.names)}"
            reasons[site.number] = (*before, told)
            continue
        found[site.number] = exact
        rest = exact.rest if site.accepted else rest
        if site.deposit is None:
            continue
        if fault := request.skipped.get(name_deposit(site.number)):
            forms[site.number] = DepositForm(reason=StockError(fault, _list_stock(site)).describe(facts.names))
            continue
        try:
            refuse_doubles(site.deposit, exact.pieces, exact.doubles)
            with at_work(name_deposit(site.number), request.seconds):
                made = find_deposit(site.deposit, site.damage, exact.pieces, exact.rest, faces, part, request.tolerance)
            deposits[site.number], forms[site.number] = made, _describe_deposit(made, request.enlarged)
        except StockError as error:
            forms[site.number] = DepositForm(reason=error.describe(facts.names))
    missing = {number: tried for number, tried in reasons.items() if number not in found}
    writing = Writing(request, facts, missing, forms)
    write_all(writing, found, deposits, rest)
    said = {number: ExactForm("none", tried=tried) for number, tried in writing.reasons.items()}
    said |= {number: _describe(found[number], request.enlarged) for number in writing.exact}
    said = {number: replace(form, deposit=forms[number]) for number, form in said.items()}
    return Made(tuple(writing.files), tuple(writing.notes), said)


@contextmanager
def _watch(request: Request, site: SiteInput, form: str) -> Iterator[str]:
    """While a form of a site's damage volume is tried: a crash, or too much time, costs this form alone."""
    name = name_form(site.number, form)
    with at_work(name, limit_form(request.seconds)):
        yield request.skipped.get(name, "")


def _list_stock(site: SiteInput) -> list[int]:
    """The CAD faces that stock is on."""
    return (
        [number for number, height in site.deposit.heights if height > 0] if isinstance(site.deposit, Deposit) else []
    )


def _tell_faces(site: SiteInput, part: Part, names: Sequence[str]) -> str:
    """The CAD faces that a damage takes skin of."""
    assert part.faces_brep is not None
    outer = site.damage.triangles[~find_inner_faces(site.damage, part)].mean(axis=1)
    return list_faces(part.faces_brep[closest_on_mesh(outer, part)[1]].tolist(), names)


def take_solids(model: Model, request: Request) -> MovedSolids:
    """The solids of the part, enlarged as the request says: those of its CAD file, moved where the part was adapted.
    Raises MoveError where they cannot be."""
    scale = request.scale
    shapes = [scale_shape(solid, scale) if abs(scale - 1) > 1e-12 else solid for solid in model.solids]
    if request.field is None:
        return MovedSolids([lower_claims(shape, CLAIMS * request.tolerance) for shape in shapes], 0.0)
    with at_work(ADAPTING, request.seconds):
        return move_solids(shapes, request.field, request.part, request.tolerance)


def write_part(request: Request, file: str) -> str:
    """Writes the solids of the part as BREP, in millimetres; gives why not, where its faces could not be moved."""
    from OCP.BRepTools import BRepTools

    with at_work(WHOLE, request.seconds):
        path = Path(request.part.path)
        try:
            cad = take_solids(read(path, path.suffix.lower()), request)
        except MoveError as error:
            return str(error)
        BRepTools.Write_s(scale_shape(join_shapes(cad.solids), 1 / request.enlarged), file)
    return ""


def _explore_faces(solid: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_FACE

    return explore(solid, TopAbs_FACE)


def _describe(exact: Exact, enlarged: float) -> ExactForm:
    origins = [origin for piece in exact.pieces for origin in piece.origins]
    measured = exact.measured
    return ExactForm(
        exact.form, len(origins), sum(tool >= 0 for _, tool in origins), measured.volume / enlarged**3,
        measured.distance / enlarged, measured.farthest / enlarged, measured.beyond, round(exact.seconds, 3),
        exact.tried,
    )  # fmt: skip


def _describe_deposit(deposit: ExactDeposit, enlarged: float) -> DepositForm:
    origins = [origin for piece in deposit.pieces for origin in piece.origins]
    offsets = sum(number >= 0 and kind == STOCK for number, kind in origins)
    return DepositForm(
        len(origins), offsets, deposit.volume / enlarged**3, deposit.distance / enlarged, deposit.farthest / enlarged,
        round(deposit.seconds, 3),
    )  # fmt: skip
