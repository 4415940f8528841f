"""Finds the exact forms of all sites and writes them, in a process of its own: OpenCASCADE can crash or hang."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from damageest.isolation import at_work
from damageest_cadquery._kept import find_made, find_solved, keep_solved
from damageest_cadquery._output import Writing, write_all
from damageest_cadquery._request import ADAPTING, WHOLE, CadFacts, Made, Request, describe_none
from damageest_cadquery._sites import SiteWork
from damageest_cadquery.cutting.exact_damage import scale_shape, start_solids
from damageest_cadquery.moving.adapted import MovedSolids, move_solids
from damageest_cadquery.moving.moved import MoveError
from damageest_cadquery.reading.claims import lower_claims
from damageest_cadquery.reading.colours import read_colours
from damageest_cadquery.reading.read import Model, explore, read
from damageest_cadquery.writing.write_shapes import join_shapes

CLAIMS = 0.01
"""Largest tolerance of an edge, in tolerances of the job, that is taken as the CAD file claims it."""


def make_exact(request: Request) -> Made:
    """Finds the exact forms and writes the files. It notes what is at work, so that where it stops, it can be started
    again without that."""
    with at_work(WHOLE, request.allow(request.seconds)):
        return _make(request)


def _make(request: Request) -> Made:
    part = request.part
    model = read(Path(part.path), Path(part.path).suffix.lower())
    try:
        cad = take_solids(model, request)
    except MoveError as error:
        why = f"the faces of the CAD file could not be adapted: {error}"
        none = {site.number: describe_none(site, why) for site in request.sites}
        return Made((), ("damage.step and undamaged.step have facets too",), none)
    solids, faces = start_solids(cad.solids)
    originals = [face for solid in model.solids for face in _explore_faces(solid)]
    facts = CadFacts(
        [model.name_of(face) or f"face {number}" for number, face in enumerate(originals)],
        read_colours(Path(part.path), len(originals)),
        model.solid_names,
    )
    work = SiteWork(request, solids, faces, facts, cad.off)
    rest, solved = solids, {}
    for site in request.sites:
        kept = find_solved(request.keep, site.number)
        found = solved[site.number] = kept or work.solve(site, rest if site.accepted else solids)
        if request.keep and not kept:
            keep_solved(request.keep, site.number, found)
        rest = found.exact.rest if found.exact is not None and site.accepted else rest
    before = find_made(request.keep)
    writing = Writing(request, facts, solved, {}, list(before.files), list(before.notes), before)
    write_all(writing, rest)
    return writing.tell()


def take_solids(model: Model, request: Request) -> MovedSolids:
    """The solids of the part, enlarged as the request says: those of its CAD file, moved where the part was adapted.
    Raises MoveError where they cannot be."""
    scale = request.scale
    shapes = [scale_shape(solid, scale) if abs(scale - 1) > 1e-12 else solid for solid in model.solids]
    if request.field is None:
        return MovedSolids([lower_claims(shape, CLAIMS * request.tolerance) for shape in shapes], 0.0)
    with at_work(ADAPTING, request.allow(request.seconds)):
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
