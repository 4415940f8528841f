"""Finds the exact damage volume of a site: the part's CAD solids split by its inner damage surface.

Tried in this order, and the first that passes the checks is taken: recognised shapes, splines, planes beside facets,
few facets, more. Where planes explain most of it, they come before splines.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Solid, Surface
from damageest_cadquery.cutting._attempts import call, list_tools
from damageest_cadquery.cutting._balance import Balance
from damageest_cadquery.cutting._pieces import Taken, count_bodies, take_pieces
from damageest_cadquery.cutting.check_pieces import Measured, Target, check_pieces, measure_inner_area
from damageest_cadquery.reading.claims import find_coarse
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.split import Piece, Tool, is_sound
from damageest_cadquery.surfaces.open_surface import make_cut

MOST_FACES = 5000
FLAT = ("planes", "facets")
"""Kinds of forms of flat faces alone."""
VOLUME = "its volume"
"""How the reason begins where the volume is refused."""
WANTED = 0.003
"""Relative difference of the volumes, beside chords, from which later forms are tried too, and the nearest is taken."""
NEARER, STALE = 0.75, 2
"""A kind of form, but for facets, is given up where so many of it are off in volume by more than this share of the best
one's: they follow the same planes."""


@dataclass(frozen=True, eq=False)
class SiteInput:
    """A site as the exact form needs it, in the job's unit and the part's frame."""

    number: int
    damage: Solid
    surface: Surface
    enclosures: tuple[Solid, ...]
    points: Floats
    accepted: bool
    deposit: Solid | None = None


@dataclass(frozen=True, eq=False)
class Exact:
    """``pieces``: the damage volume; ``rest``: what is left of the solids; ``form``: shapes, spline, planes or facets;
    ``seconds``: of the processor; ``tried``: what was refused before, and why; ``doubles``: pieces that lie in those of
    the damage volume, of solids that the file holds twice."""

    pieces: tuple[Piece, ...]
    rest: tuple[Piece, ...]
    form: str
    measured: Measured
    seconds: float
    tried: tuple[str, ...] = ()
    doubles: tuple[Piece, ...] = ()


def start_solids(solids: Sequence[Any]) -> tuple[tuple[Piece, ...], tuple[Any, ...]]:
    """The part's solids as pieces, and its faces by their number."""
    from OCP.TopAbs import TopAbs_FACE

    pieces: list[Piece] = []
    faces: list[Any] = []
    for owner, solid in enumerate(solids):
        own = explore(solid, TopAbs_FACE)
        pieces.append(Piece(solid, owner, tuple((len(faces) + k, -1) for k in range(len(own)))))
        faces += own
    return tuple(pieces), tuple(faces)


def find_exact(
    site: SiteInput,
    solids: Sequence[Piece],
    faces: Sequence[Any],
    part: Part,
    tolerance: float,
    off: float = 0.0,
    watch: Callable[[str], AbstractContextManager[str]] = lambda form: nullcontext(""),
    seconds: float = np.inf,
) -> tuple[Exact | None, tuple[str, ...]]:
    """The exact damage volume of a site in ``solids``, which are in the job's unit, or None; and what was refused.

    ``off``: how far corners of ``solids`` may lie off their faces. ``watch``: what a form is tried in, by its name; it
    gives why it must not be tried, or nothing. After ``seconds`` of the processor no further form is tried.
    """
    start, tried = time.process_time(), []
    cut = make_cut(site.damage, site.surface, part, site.enclosures, tolerance)
    if cut is None:
        return None, ("no surface is known that cuts it out of the part",)
    bodies, refused = count_bodies(site.damage, solids, tolerance), ""
    second: Exact | None = None
    stale, best = Counter[str](), dict[str, float]()
    target = Target(site.damage, site.surface, site.points, part, tolerance, faces, off)
    work = _Work(site, solids, target, bodies, measure_inner_area(solids))
    coarse = find_coarse([piece.shape for piece in solids], tolerance)
    balance = Balance(solids, part, site.damage, tolerance)
    for form, make, fuzzies, shift in list_tools(cut, part, tolerance):
        kind = form.split()[0]
        if kind == refused:
            continue  # another width of the same shapes
        if time.process_time() - start > seconds:
            tried.append(f"it took longer than {seconds:g} s")
            break
        with watch(form) as barred:
            if barred:
                tried.append(f"{form}: {barred}")
                continue
            tool = call(make)
            for fuzzy in [*fuzzies, *(coarse if kind in FLAT else ())] if tool is not None else ():
                assert tool is not None
                trial = work.split(tool, kind, fuzzy)
                if shift is not None and trial.is_near:
                    trial = _move(work, balance, trial, shift, kind, fuzzy)
                measured = trial.measured
                if not measured.reason:
                    spent, off_by = time.process_time() - start, balance.measure_off(trial.pieces)
                    found = Exact(trial.pieces, trial.rest, kind, measured, spent, tuple(tried), trial.doubles)
                    if abs(off_by) <= WANTED:
                        return found, tuple(tried)
                    # room for chords was larger than these: a later form may be nearer
                    tried.append(f"{form}: {VOLUME} differs by {off_by:+.2%} beside chords")
                    second = found if abs(off_by) < min(best.values(), default=np.inf) else second
                    stale[kind] += kind != "facets" and abs(off_by) > NEARER * best.get(kind, np.inf)
                    refused = kind if stale[kind] >= STALE else refused
                    best[kind] = min(best.get(kind, np.inf), abs(off_by))
                    break
                tried.append(f"{form}: {measured.reason}")
                if trial.is_final:
                    refused = "shapes" if trial.is_near else refused
                    break
    if second is not None:
        return replace(second, seconds=time.process_time() - start, tried=tuple(tried)), tuple(tried)
    return None, tuple(tried) or ("no surface could be built that cuts it out of the part",)


@dataclass(frozen=True, eq=False)
class _Trial:
    """What a tool gave. ``is_near``: it is sound, and refused by its volume or its distances, if at all."""

    measured: Measured
    pieces: tuple[Piece, ...] = ()
    rest: tuple[Piece, ...] = ()
    is_final: bool = False
    doubles: tuple[Piece, ...] = ()

    @property
    def is_near(self) -> bool:
        reason = self.measured.reason
        return bool(self.pieces) and (not reason or np.isfinite(self.measured.farthest) or reason.startswith(VOLUME))


@dataclass(frozen=True, eq=False)
class _Work:
    """A site, the solids that it is cut out of, and what the checks need to know of them."""

    site: SiteInput
    solids: Sequence[Piece]
    target: Target
    bodies: int
    inner_before: float

    @property
    def faces(self) -> Sequence[Any]:
        return self.target.cad_faces

    def split(self, tool: Tool, kind: str, fuzzy: float) -> _Trial:
        """What a tool gives, checked."""
        site = self.site
        found = take_pieces(self.solids, tool, fuzzy, site.damage, self.target.tolerance)
        if isinstance(found, str):
            return _Trial(Measured(0.0, found))
        pieces, rest = found.damage, found.rest
        if sum(len(piece.origins) for piece in pieces) > MOST_FACES:
            return _Trial(Measured(0.0, f"more than {MOST_FACES} faces"), is_final=True)
        measured = self._check(kind, found, pieces)
        if measured.reason and np.isfinite(measured.farthest) and found.specks:
            # the mesh's surface at a speck that is left out can be far from all others
            pieces = (*pieces, *found.specks)
            measured = self._check(kind, found, pieces)
        if not measured.reason and not is_sound([piece for piece in rest if piece not in self.solids], self.faces):
            measured = replace(measured, reason="what it leaves of the part is not valid", farthest=np.nan)
        # where it is sound but not near enough, another fuzzy value does not change that
        final = np.isfinite(measured.farthest) or measured.reason.startswith(VOLUME)
        return _Trial(measured, pieces, rest, bool(final), found.doubles)

    def _check(self, kind: str, found: Taken, pieces: Sequence[Piece]) -> Measured:
        elsewhere = measure_inner_area(found.rest) - self.inner_before
        elsewhere -= measure_inner_area([*found.doubles, *found.specks])
        bodies = self.bodies + len(pieces) - len(found.damage)
        return check_pieces(kind, pieces, elsewhere, bodies, self.target)


def _move(
    work: _Work, balance: Balance, trial: _Trial, shift: Callable[[float], Tool | None], kind: str, fuzzy: float
) -> _Trial:
    """The trial with the tool moved so that the volume is the mesh's, where that is off and the moved one passes."""
    step = balance.find_step(trial.pieces)
    tool = call(partial(shift, step)) if step else None
    moved = None if tool is None else work.split(tool, kind, fuzzy)
    return trial if moved is None or moved.measured.reason else moved


def scale_shape(shape: Any, factor: float, T: Floats | None = None) -> Any:
    """A shape scaled about the origin, then moved by ``T`` (4,4); its faces stay in their order."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    transform = gp_Trsf()
    if T is not None:
        transform.SetValues(*np.asarray(T)[:3].ravel().tolist())
    if factor != 1.0:
        size = gp_Trsf()
        size.SetScaleFactor(factor)
        transform = transform.Multiplied(size)
    return BRepBuilderAPI_Transform(shape, transform, True).Shape()
