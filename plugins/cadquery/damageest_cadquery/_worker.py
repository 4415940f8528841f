"""Finds the exact forms of all sites and writes them, in a process of its own: OpenCASCADE can crash or hang.

``python -m damageest_cadquery._worker REQUEST`` reads a pickled `Request` and writes the files. On its standard output
it says where it is: a line of JSON at the start and at the end of each site, with the negative of its number where its
deposit begins, and one at the end with what it wrote.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from damageest.artefacts import Floats, Part
from damageest.stages.export import Body, DepositForm, ExactForm
from damageest_cadquery._assembly import Colour, NamedShape, write_assembly
from damageest_cadquery._colours import read_colours
from damageest_cadquery._deposit import STOCK, ExactDeposit, find_deposit
from damageest_cadquery._exact import Exact, SiteInput, find_exact, scale_shape, start_solids
from damageest_cadquery._read import explore, read
from damageest_cadquery._solids import StockError
from damageest_cadquery._split import Piece, join_pieces

INNER: Colour = (215, 50, 40)
TOP: Colour = (40, 130, 205)
SIDE: Colour = (140, 185, 225)
PLAIN: Colour = (150, 155, 165)


@dataclass(frozen=True, eq=False)
class Request:
    """All lengths in millimetres, in the part's frame. ``scale``: millimetres of one length of the CAD file as read.

    ``folder``: where to write; ``places``: prefixes of the files with the transform (4,4) to their frame; ``unit``: of
    the files; ``bodies``: what has no exact form, by the stem of its file, for the assembly; ``skipped``: sites that
    stopped this process before, and why; their deposits by the negative of the number.
    """

    part: Part
    scale: float
    tolerance: float
    unit: str
    sites: tuple[SiteInput, ...]
    bodies: Mapping[str, Body]
    folder: str
    places: Mapping[str, Floats | None]
    skipped: Mapping[int, str]


@dataclass(frozen=True, eq=False)
class CadFacts:
    """``names`` and ``colours`` of the part's CAD faces by number, ``solids``: the names of its solids. A face without
    a name in the file is called by its number, as `damageest faces` lists it."""

    names: Sequence[str]
    colours: Sequence[Colour | None]
    solids: Sequence[str]


def main(path: Path) -> None:
    request: Request = pickle.loads(path.read_bytes())
    part = request.part
    model = read(Path(part.path), Path(part.path).suffix.lower())
    shapes = [scale_shape(solid, request.scale) if abs(request.scale - 1) > 1e-12 else solid for solid in model.solids]
    solids, faces = start_solids(shapes)
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
        _tell(start=site.number)
        if site.number in request.skipped:
            exact, reasons[site.number] = None, (request.skipped[site.number],)
        else:
            around = rest if site.accepted else solids
            exact, reasons[site.number] = find_exact(site, around, faces, part, request.tolerance)
        if exact is not None:
            found[site.number] = exact
            rest = exact.rest if site.accepted else rest
        forms[site.number] = describe_missing(site)
        if exact is not None and site.deposit is not None:
            _tell(start=-site.number)
            try:
                if -site.number in request.skipped:
                    raise StockError(request.skipped[-site.number])
                made = find_deposit(site.deposit, site.damage, exact.pieces, exact.rest, faces, part, request.tolerance)
                deposits[site.number], forms[site.number] = made, _describe_deposit(made)
            except StockError as error:
                forms[site.number] = DepositForm(reason=str(error))
        _tell(done=site.number)
    _tell(start=0)
    complete = all(site.number in found for site in request.sites if site.accepted)
    files = _write(request, found, deposits, rest if complete else None, facts)
    said = {number: ExactForm("none", tried=tried) for number, tried in reasons.items()}
    said |= {number: _describe(exact) for number, exact in found.items()}
    _tell(files=files, forms={number: asdict(replace(form, deposit=forms[number])) for number, form in said.items()})


def _explore_faces(solid: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_FACE

    return explore(solid, TopAbs_FACE)


def _describe(exact: Exact) -> ExactForm:
    origins = [origin for piece in exact.pieces for origin in piece.origins]
    measured = exact.measured
    return ExactForm(
        exact.form, len(origins), sum(tool >= 0 for _, tool in origins), measured.volume, measured.distance,
        measured.farthest, measured.beyond, round(exact.seconds, 3), exact.tried,
    )  # fmt: skip


def describe_missing(site: SiteInput) -> DepositForm | None:
    """What to say of a deposit whose damage volume has no exact form; None where there is no deposit."""
    return None if site.deposit is None else DepositForm(reason="its damage volume has facets too")


def _describe_deposit(deposit: ExactDeposit) -> DepositForm:
    origins = [origin for piece in deposit.pieces for origin in piece.origins]
    offsets = sum(number >= 0 and kind == STOCK for number, kind in origins)
    return DepositForm(
        len(origins), offsets, deposit.volume, deposit.distance, deposit.farthest, round(deposit.seconds, 3)
    )


def _write(
    request: Request,
    found: Mapping[int, Exact],
    deposits: Mapping[int, ExactDeposit],
    rest: Sequence[Piece] | None,
    facts: CadFacts,
) -> list[str]:
    """Writes the exact solids, and the assembly of all; gives the paths relative to the folder."""
    shapes: dict[str, NamedShape] = {}
    for number, exact in found.items():
        accepted = next(site.accepted for site in request.sites if site.number == number)
        stem, name = (f"damage/site-{number}", f"damage site-{number}")
        if not accepted:
            stem, name = f"doubtful/site-{number}", f"doubtful site-{number}"
        shapes[stem] = _name(exact.pieces, name, request.bodies[stem].colour, facts, name)
    union = [shape for stem, shape in shapes.items() if stem.startswith("damage/")]
    for number, deposit in deposits.items():
        stem, name = f"deposit/site-{number}", f"deposit site-{number}"
        shapes[stem] = _name(deposit.pieces, name, request.bodies[stem].colour, facts, f"damage site-{number}")
    if rest is not None and union:
        shapes["damage"] = join_named("damage", union, request.bodies["damage"].colour)
        shapes |= _name_rest(rest, request.bodies, facts)
    files: list[str] = []
    for place, T in request.places.items():
        here = {stem: _move(shape, T) for stem, shape in shapes.items()}
        for stem, shape in here.items():
            if "#" not in stem:
                files.append(_save(request, f"{place}{stem}", shape.name, [shape]))
        everything = _collect(request.bodies, here, T)
        if everything:
            files.append(_save(request, f"{place}result", "result", everything))
    return files


def _save(request: Request, stem: str, name: str, shapes: Sequence[NamedShape]) -> str:
    _tell(start=0)  # each file has the time of a site
    path = Path(request.folder) / f"{stem}.step"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_assembly(path, name, shapes, request.unit)
    return f"{stem}.step"


def _collect(bodies: Mapping[str, Body], shapes: Mapping[str, NamedShape], T: Floats | None) -> list[NamedShape]:
    """What the assembly holds: what is left of the part, damage volumes and deposits, with facets where they have no
    exact form."""
    from damageest.geometry.transforms import move_mesh
    from damageest_cadquery._step import MAX_FACES, build_solid

    found = []
    for stem, body in bodies.items():
        if stem == "damage" or stem.startswith("doubtful/"):
            continue
        apart = [shape for name, shape in shapes.items() if name.startswith(f"{stem}#")]
        if apart or stem in shapes:
            found += apart or [shapes[stem]]
            continue
        solid = body.solid if T is None else move_mesh(body.solid, T)
        shape, count = build_solid(solid)
        if count <= MAX_FACES:
            found.append(NamedShape(body.name, shape, body.colour))
    return found


def _name(pieces: Sequence[Piece], name: str, colour: Colour, facts: CadFacts, inner: str) -> NamedShape:
    """One shape of pieces, whose faces have the names and colours of the CAD faces that they come from."""
    names, colours = [], []
    for piece in pieces:
        for number, tool in piece.origins:
            if tool == STOCK:
                names.append(f"stock on {facts.names[number]}" if number >= 0 else "side of the stock")
                colours.append(TOP if number >= 0 else SIDE)
                continue
            names.append(facts.names[number] if number >= 0 else f"{inner} inner {tool + 1}")
            colours.append((facts.colours[number] or PLAIN) if number >= 0 else INNER)
    return NamedShape(name, join_pieces(pieces), colour, names, colours)


def _name_rest(rest: Sequence[Piece], bodies: Mapping[str, Body], facts: CadFacts) -> dict[str, NamedShape]:
    """What is left of the part as one shape, and where the CAD file has several solids, each of them for the
    assembly."""
    colour = bodies["undamaged"].colour
    owners = sorted({piece.owner for piece in rest})
    shapes = {"undamaged": _name(rest, "undamaged part", colour, facts, "undamaged")}
    if len(facts.solids) > 1:
        for owner in owners:
            own = [piece for piece in rest if piece.owner == owner]
            title = facts.solids[owner] or f"solid {owner + 1}"
            shapes[f"undamaged#{owner}"] = _name(own, f"undamaged {title}", colour, facts, "undamaged")
    return shapes


def join_named(name: str, shapes: Sequence[NamedShape], colour: Colour) -> NamedShape:
    """Several shapes as one."""
    if len(shapes) == 1:
        return replace(shapes[0], name=name)
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for each in shapes:
        builder.Add(whole, each.shape)
    names = [name for each in shapes for name in each.names]
    return NamedShape(name, whole, colour, names, [colour for each in shapes for colour in each.colours])


def _move(shape: NamedShape, T: Floats | None) -> NamedShape:
    return shape if T is None else replace(shape, shape=scale_shape(shape.shape, 1.0, T))


def _tell(**what: Any) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
