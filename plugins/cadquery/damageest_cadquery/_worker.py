"""Finds the exact forms of all sites and writes them, in a process of its own: OpenCASCADE can crash or hang.

``python -m damageest_cadquery._worker REQUEST LEASH`` reads a pickled `Request` and writes the files. It ends when the
process that holds the other end of the open file LEASH ends. On its standard output it says where it is: a line of JSON
at the start and at the end of each site, with the negative of its number where its deposit begins, one for each file,
and one at the end with what it wrote.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from damageest.isolation import end_with_parent
from damageest.stages.export import DepositForm, ExactForm
from damageest_cadquery._colours import read_colours
from damageest_cadquery._deposit import STOCK, ExactDeposit, find_deposit
from damageest_cadquery._exact import Exact, find_exact, scale_shape, start_solids
from damageest_cadquery._output import Writing, write_all
from damageest_cadquery._read import explore, read
from damageest_cadquery._request import CadFacts, Request, describe_missing, tell
from damageest_cadquery._solids import StockError


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
        tell(start=site.number)
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
            tell(start=-site.number)
            try:
                if -site.number in request.skipped:
                    raise StockError(request.skipped[-site.number])
                made = find_deposit(site.deposit, site.damage, exact.pieces, exact.rest, faces, part, request.tolerance)
                deposits[site.number], forms[site.number] = made, _describe_deposit(made)
            except StockError as error:
                forms[site.number] = DepositForm(reason=str(error))
        tell(done=site.number)
    tell(start=0)
    missing = {number: tried for number, tried in reasons.items() if number not in found}
    writing = Writing(request, facts, missing, forms)
    write_all(writing, found, deposits, rest)
    said = {number: ExactForm("none", tried=tried) for number, tried in writing.reasons.items()}
    said |= {number: _describe(found[number]) for number in writing.exact}
    tell(
        files=writing.files,
        notes=writing.notes,
        forms={number: asdict(replace(form, deposit=forms[number])) for number, form in said.items()},
    )


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


def _describe_deposit(deposit: ExactDeposit) -> DepositForm:
    origins = [origin for piece in deposit.pieces for origin in piece.origins]
    offsets = sum(number >= 0 and kind == STOCK for number, kind in origins)
    return DepositForm(
        len(origins), offsets, deposit.volume, deposit.distance, deposit.farthest, round(deposit.seconds, 3)
    )


def start(arguments: Sequence[str]) -> None:
    """Serves the request that the first argument names, on the leash of the second."""
    path, leash = arguments
    end_with_parent(int(leash))
    main(Path(path))


if __name__ == "__main__":
    start(sys.argv[1:])
