"""Finds the exact forms of one site: damage volume, metal that is milled off before deposition, and deposit."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from damageest.artefacts import Deposit, Part, Solid
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.skin import find_inner_faces
from damageest.isolation import at_work
from damageest.stages.export import DepositForm, ExactForm, MilledForm
from damageest_cadquery._request import (
    SPENT,
    CadFacts,
    Request,
    describe_missing,
    describe_unmilled,
    limit_form,
    name_crossed,
    name_deposit,
    name_form,
    name_milled,
    name_opened,
    name_site,
)
from damageest_cadquery.cutting.crossed import find_crossed
from damageest_cadquery.cutting.exact_damage import Exact, SiteInput, find_exact
from damageest_cadquery.solids.joining import StockError, list_faces
from damageest_cadquery.solids.split import Piece
from damageest_cadquery.stock.deposit import STOCK, ExactDeposit, find_deposit, refuse_doubles
from damageest_cadquery.stock.opened import ExactMilled, find_milled, take_opened


@dataclass(frozen=True, eq=False)
class Solved:
    """What was found for a site. ``exact``: its damage volume, None where it has no exact form; ``tried``: what was
    refused. ``deposit`` and ``milled`` likewise, with what is to be said of them."""

    exact: Exact | None
    tried: tuple[str, ...]
    deposit: ExactDeposit | None = None
    deposit_form: DepositForm | None = None
    milled: ExactMilled | None = None
    milled_form: MilledForm | None = None


@dataclass(frozen=True, eq=False)
class SiteWork:
    """What all sites have in common: the part's ``solids`` and its ``faces`` by number, ``facts`` of the CAD file, and
    how far corners may lie ``off`` their faces."""

    request: Request
    solids: tuple[Piece, ...]
    faces: tuple[Any, ...]
    facts: CadFacts
    off: float

    def solve(self, site: SiteInput, around: Sequence[Piece]) -> Solved:
        """The exact forms of a site; its damage volume is cut out of ``around``."""
        exact, tried = self._cut_out(site, around, name_site(site.number))
        if exact is None:
            tried = (*tried[:-1], self._explain(site, tried[-1]))
        opened = take_opened(site, self.request.part)
        if opened is None:
            if exact is None or site.deposit is None:
                return Solved(exact, tried, None, describe_missing(site), None, describe_unmilled(site))
            return Solved(exact, tried, *self._find_deposit(site, site.damage, exact))
        # other sites are left out of the cavity, so it is cut out of the part as designed
        cavity, refused = self._cut_out(opened, self.solids, name_opened(site.number))
        if cavity is None:
            missing = describe_missing(site, "opened cavity"), None, describe_unmilled(site, refused)
            return Solved(exact, tried, None, *missing)
        made = self._find_deposit(site, opened.damage, cavity)
        return Solved(exact, tried, *made, *self._find_milled(site, cavity, exact))

    def _cut_out(self, site: SiteInput, around: Sequence[Piece], name: str) -> tuple[Exact | None, tuple[str, ...]]:
        """What `find_exact` gives, unless this stopped the process before."""
        request = self.request
        if fault := request.skipped.get(name):
            return None, (fault,)
        if time.process_time() > request.solving:
            return None, (SPENT,)
        seconds = request.allow(request.seconds, request.solving)
        with at_work(name, seconds):
            watch = partial(_watch, request, name)
            return find_exact(site, around, self.faces, request.part, request.tolerance, self.off, watch, seconds)

    def _explain(self, site: SiteInput, last: str) -> str:
        """Why a damage volume has no exact form, with the faces that it lies on."""
        request, names = self.request, self.facts.names
        if name_site(site.number) in request.skipped or time.process_time() > request.solving:
            return last
        with at_work(name_crossed(site.number), request.allow(request.seconds, request.solving)):
            skipped = name_crossed(site.number) in request.skipped
            crossed = [] if skipped else find_crossed(self.solids, self.faces, site.damage, request.tolerance)
        told = f"{last}; it lies on {_report_faces(site, request.part, names)}"
        return f"{told}; in the CAD file these cross one another: {list_faces(crossed, names)}" if crossed else told

    def _find_deposit(self, site: SiteInput, cavity: Solid, exact: Exact) -> tuple[ExactDeposit | None, DepositForm]:
        """The deposit on the exact form of its ``cavity``, and what is to be said of it."""
        request, name, deposit = self.request, name_deposit(site.number), site.deposit
        assert deposit is not None
        try:
            if fault := request.skipped.get(name):
                raise StockError(fault, _list_stock(deposit))
            if time.process_time() > request.solving:
                raise StockError(SPENT)
            refuse_doubles(deposit, exact.pieces, exact.doubles)
            with at_work(name, request.allow(request.seconds, request.solving)):
                made = find_deposit(
                    deposit, cavity, exact.pieces, exact.rest, self.faces, request.part, request.tolerance
                )
        except StockError as error:
            return None, DepositForm(reason=error.describe(self.facts.names))
        return made, _describe_deposit(made, request.enlarged)

    def _find_milled(
        self, site: SiteInput, cavity: Exact, exact: Exact | None
    ) -> tuple[ExactMilled | None, MilledForm]:
        """What is to be milled off for the exact ``cavity``, and what is to be said of it."""
        request, name = self.request, name_milled(site.number)
        assert isinstance(site.deposit, Deposit)
        try:
            if exact is None:
                raise StockError("its damage volume has facets too")
            if fault := request.skipped.get(name):
                raise StockError(fault)
            if time.process_time() > request.solving:
                raise StockError(SPENT)
            with at_work(name, request.allow(request.seconds, request.solving)):
                made = find_milled(cavity, exact, site.deposit, request.part, request.tolerance)
        except StockError as error:
            return None, _describe_milled(cavity, None, str(error), request.enlarged)
        return made, _describe_milled(cavity, made, "", request.enlarged)


@contextmanager
def _watch(request: Request, whose: str, form: str) -> Iterator[str]:
    """While a form of a damage volume or a cavity is tried: a crash, or too much time, costs this form alone."""
    name = name_form(whose, form)
    late = SPENT if time.process_time() > request.solving else ""
    with at_work(name, request.allow(limit_form(request.seconds), request.solving)):
        yield request.skipped.get(name, late)


def _list_stock(deposit: Solid) -> list[int]:
    """The CAD faces that stock is on."""
    return [number for number, height in deposit.heights if height > 0] if isinstance(deposit, Deposit) else []


def _report_faces(site: SiteInput, part: Part, names: Sequence[str]) -> str:
    """The CAD faces that a damage takes skin of."""
    assert part.faces_brep is not None
    outer = site.damage.triangles[~find_inner_faces(site.damage, part)].mean(axis=1)
    return list_faces(part.faces_brep[closest_on_mesh(outer, part)[1]].tolist(), names)


def describe_exact(exact: Exact, enlarged: float) -> ExactForm:
    """What the result says of a damage volume; lengths of ``exact`` are ``enlarged`` times those of the job."""
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


def _describe_milled(cavity: Exact, milled: ExactMilled | None, reason: str, enlarged: float) -> MilledForm:
    measured = cavity.measured
    origins = [] if milled is None else [origin for piece in milled.pieces for origin in piece.origins]
    return MilledForm(
        cavity.form, len(origins), sum(tool >= 0 for _, tool in origins),
        None if milled is None else milled.volume / enlarged**3, measured.distance / enlarged,
        measured.farthest / enlarged, measured.beyond,
        round(cavity.seconds + (0.0 if milled is None else milled.seconds), 3), cavity.tried, reason,
    )  # fmt: skip
