"""Steps round the stage `allowance`: the other sites, sites that it refuses, and deposits that overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import Deposit, Floats, Solid
from damageest.errors import StageError
from damageest.geometry.bubbles import find_bubbles
from damageest.geometry.solids import concatenate_meshes, subtract_lost, to_manifold, to_solid, unite
from damageest.geometry.touching import separate_sheets
from damageest.pipeline.engine import Engine
from damageest.pipeline.finding.pores import PORE
from damageest.pipeline.stage_errors import locate_error
from damageest.pipeline.state import Failures, FoundSite, JobState
from damageest.pipeline.steps import step
from damageest.stages.allowance import Allowance

SPECK, TOLD = 1e-9, 1e-5
"""Shares of a deposit's volume: below the first, an overlap is rounding; below the second, not reported."""


@step(gives=("found", "failures"), reads=("found", "part", "tolerance"), calls=(Allowance,))
def make_deposits(engine: Engine, state: JobState) -> tuple[tuple[FoundSite, ...], Failures]:
    """Makes the deposit of each accepted site. A site that the stage refuses keeps its damage volume; what to deposit
    is not known. No volume is in two deposits."""
    told = "others" in type(engine.job.stages[Allowance]).needs()
    done: list[FoundSite] = []
    failures: list[StageError] = []
    for site in state.found:
        if not site.accepted or site.method == PORE:
            done.append(replace(site.with_value(FoundSite.deposit, None), refused=site.method == PORE))
            continue
        rest = [other for other in state.found if other is not site and other.accepted]
        others = _unite([other.damage for other in rest]) if told else None
        site = replace(site.with_value(FoundSite.others, others), job=state)
        try:
            made = engine.call(Allowance, site)
            refuse_bubbles(made.deposit, made.damage, state.part)
            done.append(made)
        except StageError as error:
            if not error.stage:  # the check's own
                locate_error(error, engine.job.implementations[Allowance], site)
            failures.append(error)
            done.append(replace(site.with_value(FoundSite.deposit, None), refused=True))
    return separate_deposits(tuple(done), state.tolerance), failures


def refuse_bubbles(deposit: Solid | None, damage: Solid, part: Solid) -> None:
    """Raises StageError where a deposit encloses an empty space, which no deposition leaves."""
    if deposit is None:
        return
    origin = part.bounds.mean(axis=0)
    cavity = deposit.cavity if isinstance(deposit, Deposit) else None
    bubbles = find_bubbles(deposit, lambda: _take_left(part, cavity or damage, origin), part, origin)
    if bubbles:
        largest = max(bubbles, key=lambda each: float(each.volume()))
        box = np.reshape(largest.bounding_box(), (2, 3)).mean(axis=0) + origin
        place = ", ".join(f"{value:.4g}" for value in box)
        raise StageError(
            f"the deposit encloses an empty space of {largest.volume():.3g} in volume, near ({place})",
            "take another outer or overlap, or a keep_out that reaches out of the deposit",
        )


def _take_left(part: Solid, lost: Solid, origin: Floats) -> Any:
    return subtract_lost(to_manifold(part, origin), to_manifold(lost, origin))


def separate_deposits(found: tuple[FoundSite, ...], tolerance: float) -> tuple[FoundSite, ...]:
    """Removes from each deposit and its cavity what those of the sites before it contain, so that no volume counts
    twice."""
    done: list[FoundSite] = []
    for site in found:
        deposit = site.deposit
        if isinstance(deposit, Deposit):
            for earlier in done:
                deposit = _subtract_earlier(deposit, earlier, site.damage, tolerance)
            if deposit is not site.deposit:
                site = site.with_value(FoundSite.deposit, deposit)
        done.append(site)
    return tuple(done)


def _subtract_earlier(deposit: Deposit, earlier: FoundSite, damage: Solid, tolerance: float) -> Deposit:
    """A deposit minus the one of an earlier site, for the same damage volume."""
    other = earlier.deposit or earlier.damage
    if (deposit.bounds[0] > other.bounds[1]).any() or (other.bounds[0] > deposit.bounds[1]).any():
        return deposit
    origin = deposit.bounds.mean(axis=0)
    body, taken = to_manifold(deposit, origin), to_manifold(other, origin)
    own = to_manifold(damage, origin)
    if (taken ^ own).volume() > SPECK * damage.volume:  # the allowance ignored the other sites
        taken -= own
    common = (body ^ taken).volume()
    if common <= SPECK * deposit.volume:
        return deposit
    left = separate_sheets(body - taken, origin, tolerance)
    cavity, cut_back = deposit.cavity, deposit.cut_back_volume
    if cavity is not None:
        cavity = _shorten(cavity, taken, origin)
        cut_back = max(cavity.volume - damage.volume, 0.0)
    milled = deposit.milled if deposit.milled is None else to_solid(to_manifold(deposit.milled, origin) - taken, origin)
    if left is None:
        return deposit
    notes = deposit.notes
    if common > TOLD * deposit.volume:
        notes = (
            *notes,
            f"its deposit overlaps that of site {earlier.number} by {common:.4g} in volume, which is counted there",
        )
    return replace(
        deposit,
        vertices=left.vertices,
        faces=left.faces,
        cavity=cavity,
        milled=milled,
        stock_volume=max(left.volume - (cavity or damage).volume, 0.0),
        cut_back_volume=cut_back,
        notes=notes,
    )


def _shorten(cavity: Solid, taken: Any, origin: Floats) -> Solid:
    return to_solid(to_manifold(cavity, origin) - taken, origin) or cavity


def _unite(solids: Sequence[Solid]) -> Solid | None:
    if not solids:
        return None
    low, high = np.array([solid.bounds[0] for solid in solids]), np.array([solid.bounds[1] for solid in solids])
    meet = (low[:, None] <= high[None]).all(axis=2) & (low[None] <= high[:, None]).all(axis=2)
    if meet.sum() == len(solids):  # only each with itself
        vertices, faces, _ = concatenate_meshes(solids)
        return Solid(vertices, faces)
    origin = solids[0].bounds.mean(axis=0)
    return to_solid(unite(solids, origin), origin)
