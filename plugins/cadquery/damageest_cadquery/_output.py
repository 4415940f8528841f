"""Writes exact solids, what is left of the part, and an assembly of all; with facets where there is no exact form."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from damageest.artefacts import Floats
from damageest.isolation import at_work
from damageest.stages.export import Body, DepositForm, ExactForm
from damageest_cadquery._kept import keep_made
from damageest_cadquery._request import SPENT, CadFacts, Made, Request, name_file
from damageest_cadquery._sites import Solved, describe_exact
from damageest_cadquery.cutting.exact_damage import scale_shape
from damageest_cadquery.cutting.left import FACET, cut_facets
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.doubles import SHARED
from damageest_cadquery.solids.joining import StockError
from damageest_cadquery.solids.planar import build_solid
from damageest_cadquery.solids.split import Piece
from damageest_cadquery.stock.deposit import STOCK
from damageest_cadquery.stock.opened import FOUND
from damageest_cadquery.writing.assembly import Colour, NamedShape
from damageest_cadquery.writing.write_shapes import join_shapes, write_shapes

INNER: Colour = (215, 50, 40)
PREPARED: Colour = (235, 150, 60)
TOP: Colour = (40, 130, 205)
SIDE: Colour = (140, 185, 225)
PLAIN: Colour = (150, 155, 165)


@dataclass(eq=False)
class Writing:
    """What was written so far. ``solved``: what was found, by site; ``faults``: why files of it were not written, by
    the stem of the file; ``notes``: what is to be said of files; ``before``: what earlier processes wrote."""

    request: Request
    facts: CadFacts
    solved: Mapping[int, Solved]
    faults: dict[str, str] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    before: Made = field(default_factory=lambda: Made((), (), {}))

    def describe(self, number: int) -> ExactForm:
        """What is to be said of a site's solids, as they were written."""
        found = self.solved[number]
        deposit, milled = found.deposit_form, found.milled_form
        if fault := self.faults.get(f"deposit/site-{number}"):
            assert found.deposit is not None
            origins = [origin for piece in found.deposit.pieces for origin in piece.origins]
            faces = [face for face, kind in origins if kind == STOCK and face >= 0]
            deposit = DepositForm(reason=StockError(fault, faces).describe(self.facts.names))
        if (fault := self.faults.get(f"milled/site-{number}")) and milled is not None:
            milled = replace(milled, faces=0, prepared_faces=0, volume=None, reason=fault)
        fault = self.faults.get(f"damage/site-{number}", self.faults.get(f"doubtful/site-{number}", ""))
        if found.exact is None or fault:
            said = ExactForm("none", tried=(*found.tried, fault) if fault else found.tried)
        else:
            said = describe_exact(found.exact, self.request.enlarged)
        return replace(said, deposit=deposit, milled=milled)

    def save(self, stem: str, name: str, shapes: Sequence[NamedShape]) -> tuple[Sequence[NamedShape], str]:
        """Writes a file; gives its shapes as they were written, none where there is no file, and why."""
        file, request = name_file(stem), self.request
        if fault := request.skipped.get(file):
            self.notes.append(f"{file} was not written with the CAD's faces: {fault}")
            return (), fault
        if file in self.before.files:  # by an earlier process, and valid
            return shapes, ""
        if time.process_time() > request.left:
            return (), SPENT
        self._keep()
        path = Path(request.folder) / file
        path.parent.mkdir(parents=True, exist_ok=True)
        with at_work(file, request.allow(request.seconds)):
            scratch, chord = Path(request.scratch) / "a.step", request.tolerance / request.enlarged / 16
            done = write_shapes(scratch, path, name, shapes, request.unit, chord)
        if done.said:
            self.notes.append(f"{file} {done.said}")
        if done.made is not None:
            self.files.append(file if done.is_valid else f"{stem}-invalid.step")
        self._keep()
        return (done.made, "") if done.made is not None and done.is_valid else ((), done.fault)

    def _keep(self) -> None:
        if self.request.keep:
            keep_made(self.request.keep, self.tell())

    def tell(self) -> Made:
        """What was written so far."""
        return Made(
            tuple(self.files),
            tuple(dict.fromkeys(self.notes)),
            {number: self.describe(number) for number in self.solved},
        )


def write_all(writing: Writing, rest: Sequence[Piece]) -> None:
    """Writes the exact solids, and the assembly of all."""
    request = writing.request
    shapes = _list_shapes(writing)
    left, size = _find_left(writing, rest), 1 / request.enlarged
    for place, T in request.places.items():
        here: dict[str, NamedShape] = {}
        for stem, shape in shapes.items():
            made, fault = writing.save(f"{place}{stem}", shape.name, [_move(shape, T, size)])
            here.update((stem, each) for each in made)
            if fault:
                was_read = fault != SPENT and fault not in request.skipped.values()
                writing.faults[stem] = f"read back, {fault}" if was_read else fault
        union = (
            [_move(shape, T, size) for shape in _gather_lost(request, shapes)]
            if any(s.accepted for s in request.sites)
            else []
        )
        if left and union:
            here |= _save_whole(writing, place, [_move(shape, T, size) for shape in left], union)
        everything = _collect(request.bodies, here, T, size) if request.assembly else []
        if everything:
            writing.save(f"{place}result", "result", everything)


def _list_shapes(writing: Writing) -> dict[str, NamedShape]:
    """The exact solids of all sites, by the stems of their files."""
    bodies, facts, shapes = writing.request.bodies, writing.facts, {}
    accepted = {site.number: site.accepted for site in writing.request.sites}
    for number, found in writing.solved.items():
        stem = f"damage/site-{number}" if accepted[number] else f"doubtful/site-{number}"
        name = stem.replace("/", " ")
        if found.exact is not None:
            shapes[stem] = _name(found.exact.pieces, name, bodies[stem].colour, facts, name)
        inner, inner_colour = name, INNER
        if found.milled_form is not None:
            inner, inner_colour = f"prepared site-{number}", PREPARED
        solids = {"deposit": found.deposit, "milled": found.milled}
        for stem, solid in ((f"{kind}/site-{number}", solid) for kind, solid in solids.items()):
            if solid is not None:
                body = bodies[stem]
                shapes[stem] = _name(solid.pieces, body.name, body.colour, facts, inner, inner_colour, name)
    return shapes


def _find_left(writing: Writing, rest: Sequence[Piece]) -> list[NamedShape]:
    """What is left of each solid of the CAD file. Where an accepted site has no exact form, the solids that it touches
    have facets; empty where these cannot be made."""
    request = writing.request
    accepted = [site for site in request.sites if site.accepted]
    found = [number for number, each in writing.solved.items() if each.exact is not None]
    if not accepted or not {"damage", "undamaged"} <= set(request.bodies):
        return []
    if len({piece.owner for piece in rest}) == 1 and not any(site.number in found for site in accepted):
        writing.notes.append("damage.step and undamaged.step have facets too")
        return []
    for site in accepted:
        if site.number in found:
            continue
        cut = cut_facets(rest, site.damage, request.part, request.tolerance)
        if cut is None:
            writing.notes.append(f"damage.step and undamaged.step have facets too, because site {site.number} has")
            return []
        titles = [_call_solid(writing.facts, piece.owner) for piece in cut if (-1, FACET) in piece.origins]
        writing.notes.append(
            f"undamaged.step has facets on {', '.join(dict.fromkeys(titles))}, which site {site.number} touches; "
            "its other solids have the CAD's faces"
            if len({piece.owner for piece in cut}) > len(set(titles))
            else f"undamaged.step has facets, because site {site.number} has"
        )
        rest = cut
    return _name_rest(rest, request.bodies, writing.facts)


def _call_solid(facts: CadFacts, owner: int) -> str:
    return facts.solids[owner] or f"solid {owner + 1}"


def _gather_lost(request: Request, sites: Mapping[str, NamedShape]) -> list[NamedShape]:
    """The accepted damage volumes, with facets where they have no exact form."""
    lost = []
    for site in request.sites:
        stem = f"damage/site-{site.number}"
        if site.accepted and stem in sites:
            lost.append(sites[stem])
        elif site.accepted:
            body = request.bodies[stem]
            lost.append(NamedShape(body.name, build_solid(body.solid)[0], body.colour))
    return lost


def _save_whole(
    writing: Writing, place: str, left: Sequence[NamedShape], union: Sequence[NamedShape]
) -> dict[str, NamedShape]:
    """Writes the union of the damage volumes and what is left of the part; gives the latter for the assembly, solid by
    solid where there are several."""
    bodies = writing.request.bodies
    writing.save(f"{place}damage", "damage", [join_named("damage", union, bodies["damage"].colour)])
    whole = join_named("undamaged part", left, bodies["undamaged"].colour)
    made, _ = writing.save(f"{place}undamaged", whole.name, [whole])
    if len(left) == 1 or not made:
        return {"undamaged": made[0]} if made else {}
    return {f"undamaged#{number}": each for number, each in enumerate(left)}


def _collect(
    bodies: Mapping[str, Body], shapes: Mapping[str, NamedShape], T: Floats | None, size: float
) -> list[NamedShape]:
    """What the assembly holds: what is left of the part, damage volumes and deposits, with facets where they have no
    exact form."""
    from damageest_cadquery.writing.step import MAX_FACES

    found = []
    for stem, body in bodies.items():
        if stem == "damage" or stem.startswith("doubtful/"):
            continue
        apart = [shape for name, shape in shapes.items() if name.startswith(f"{stem}#")]
        if apart or stem in shapes:
            found += apart or [shapes[stem]]
            continue
        shape, count = build_solid(body.solid)
        if count <= MAX_FACES:
            found.append(_move(NamedShape(body.name, shape, body.colour), T, size))
    return found


def _name(
    pieces: Sequence[Piece],
    name: str,
    colour: Colour,
    facts: CadFacts,
    inner: str,
    inner_colour: Colour = INNER,
    damage: str = "",
) -> NamedShape:
    """One shape of pieces, whose faces have the names and colours of the CAD faces that they come from. ``inner``: how
    those inside the part are called; ``damage``: those that metal to mill off has in common with the damage volume."""
    names, colours = [], []
    for piece in pieces:
        for number, tool in piece.origins:
            if tool == STOCK:
                names.append(f"stock on {facts.names[number]}" if number >= 0 else "side of the stock")
                colours.append(TOP if number >= 0 else SIDE)
                continue
            if tool == SHARED:
                names.append(f"{inner} inner at {facts.names[number]}")
                colours.append(INNER)
                continue
            if tool == FOUND:
                names.append(f"{damage} inner {number + 1}")
                colours.append(INNER)
                continue
            if tool == FACET:
                names.append("facet")
                colours.append(PLAIN)
                continue
            names.append(facts.names[number] if number >= 0 else f"{inner} inner {tool + 1}")
            colours.append((facts.colours[number] or PLAIN) if number >= 0 else inner_colour)
    return NamedShape(name, join_shapes([piece.shape for piece in pieces]), colour, names, colours)


def _name_rest(rest: Sequence[Piece], bodies: Mapping[str, Body], facts: CadFacts) -> list[NamedShape]:
    """What is left of each solid of the CAD file."""
    colour, shapes = bodies["undamaged"].colour, []
    for owner in sorted({piece.owner for piece in rest}):
        own = [piece for piece in rest if piece.owner == owner]
        title = f"undamaged {_call_solid(facts, owner)}" if len(facts.solids) > 1 else "undamaged part"
        shapes.append(_name(own, title, colour, facts, "undamaged"))
    return shapes


def join_named(name: str, shapes: Sequence[NamedShape], colour: Colour) -> NamedShape:
    """Several shapes as one; a face without a name keeps none."""
    if len(shapes) == 1:
        return replace(shapes[0], name=name)
    from OCP.TopAbs import TopAbs_FACE

    names: list[str] = []
    colours: list[Colour | None] = []
    for each in shapes:
        count = len(explore(each.shape, TopAbs_FACE))
        names += each.names or [""] * count
        colours += each.colours or [None] * count
    return NamedShape(name, join_shapes([each.shape for each in shapes]), colour, names, colours)


def _move(shape: NamedShape, T: Floats | None, size: float) -> NamedShape:
    """A shape in its own size, and in its place."""
    return shape if T is None and size == 1 else replace(shape, shape=scale_shape(shape.shape, size, T))
