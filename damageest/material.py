"""Round the stage `allowance`: what it is told of the other sites, sites it refuses, and deposits that overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from damageest.artefacts import Deposit, Floats, Solid
from damageest.cache import digest
from damageest.engine import Engine, State
from damageest.errors import StageError
from damageest.solids import to_manifold, to_solid, united
from damageest.stages.allowance import Allowance

SPECK, TOLD = 1e-9, 1e-5
"""Shares of a deposit's volume: below the first, an overlap is rounding; below the second, not worth a word."""


def allowed(engine: Engine, lanes: list[State]) -> list[State]:
    """Calls `allowance` on each site. One that it refuses keeps its damage volume; what to deposit is not known."""
    ahead = []
    told = "others" in type(engine.job.stages[Allowance]).needs()
    for lane in lanes:
        rest = [other for other in lanes if other is not lane]
        others = _as_one([other["damage"] for other in rest]) if told else None
        lane = lane.add("others", others, digest("others", [other.keys["damage"] for other in rest]))
        try:
            ahead.append(engine.call(Allowance, lane))
        except StageError as error:
            engine.failures.append(error)
            ahead.append(lane.add("deposit", None, "").add("refused", True, ""))
    return ahead


def apart(engine: Engine, lanes: list[State]) -> list[State]:
    """Takes from each deposit and its cavity what those of the sites before it hold already, so that volumes add up."""
    ahead: list[State] = []
    for lane in lanes:
        deposit = lane["deposit"]
        if isinstance(deposit, Deposit):
            for earlier in ahead:
                deposit = _without(deposit, earlier, lane["damage"])
            lane = lane.add("deposit", deposit, "")
        ahead.append(lane)
    return ahead


def _without(deposit: Deposit, earlier: State, damage: Solid) -> Deposit:
    """A deposit minus the one of an earlier site, for the same damage volume."""
    other = earlier["deposit"] or earlier["damage"]
    if (deposit.bounds[0] > other.bounds[1]).any() or (other.bounds[0] > deposit.bounds[1]).any():
        return deposit
    origin = deposit.bounds.mean(axis=0)
    body, taken = to_manifold(deposit, origin), to_manifold(other, origin)
    own = to_manifold(damage, origin)
    if (taken ^ own).volume() > SPECK * damage.volume:  # of an allowance that pays no heed to its neighbours
        taken -= own
    common = (body ^ taken).volume()
    if common <= SPECK * deposit.volume:
        return deposit
    left = to_solid(body - taken, origin)
    cavity, cut_back = deposit.cavity, deposit.cut_back_volume
    if cavity is not None:
        cavity = _shortened(cavity, taken, origin)
        cut_back = max(cavity.volume - damage.volume, 0.0)
    if left is None:
        return deposit
    notes = deposit.notes
    if common > TOLD * deposit.volume:
        notes = (
            *notes,
            f"its deposit overlaps that of site {earlier.site} by {common:.4g} in volume, which is counted there",
        )
    return replace(
        deposit,
        vertices=left.vertices,
        faces=left.faces,
        cavity=cavity,
        stock_volume=max(left.volume - (cavity or damage).volume, 0.0),
        cut_back_volume=cut_back,
        notes=notes,
    )


def _shortened(cavity: Solid, taken: Any, origin: Floats) -> Solid:
    return to_solid(to_manifold(cavity, origin) - taken, origin) or cavity


def _as_one(solids: Sequence[Solid]) -> Solid | None:
    if not solids:
        return None
    origin = solids[0].bounds.mean(axis=0)
    return to_solid(united(solids, origin), origin)
