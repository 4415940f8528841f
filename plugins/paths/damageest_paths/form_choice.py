"""Chooses whether the layers of a deposit are planes, or surfaces along the floor of the cavity."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, Protocol

from damageest.artefacts import DepositPath
from damageest_paths.assemble import MUCH_SUNK
from damageest_paths.conformal import plan_conformal
from damageest_paths.directions import Planner
from damageest_paths.planar import SHORT, SUNK, plan_planar

Form = Literal["auto", "planar", "conformal"]
PLANNERS: dict[str, Planner] = {"planar": plan_planar, "conformal": plan_conformal}
POOR = 0.07
"""Share of a deposit that planes lose as planes from which surfaces along the floor are tried. Rough losses lose 2 to
7 % of themselves to the stair-step of planes beside leaning walls."""
GAIN = 0.5
"""Share of what planes lose that these may lose."""
FARTHEST = 1.1
"""Bead widths by which beads may reach out of the deposit, or as far as those of planes do."""


class Plan(Protocol):
    """Gives the path of a planner. ``along_normal``: where the job leaves the build direction to the planner, it is the
    mean normal of the open side, and no other is tried."""

    def __call__(self, planner: Planner, along_normal: bool = False) -> DepositPath: ...


def plan_in_form(form: Form, plan: Plan) -> DepositPath:
    """The path of a form. ``auto``: planes; where they lose much of the deposit because they are planes, as of the
    crescent of a worn bore, surfaces along the floor if these lose half of all that planes lose, or less."""
    if form != "auto":
        return replace(plan(PLANNERS[form]), layer_form=form)
    planar = replace(plan(PLANNERS["planar"]), layer_form="planar")
    if _measure_steps(planar) <= POOR:
        return planar
    lost = measure_lost(planar)
    conformal = replace(plan(PLANNERS["conformal"], along_normal=True), layer_form="conformal")
    if not len(conformal.points) or measure_lost(conformal) > GAIN * lost:
        return planar
    spilt = max(FARTHEST * planar.width, _measure_spill(planar))
    return conformal if _measure_spill(conformal) <= spilt else planar


def measure_lost(path: DepositPath) -> float:
    """What of the deposit is not filled, and what of the beads lies in intact metal beyond what is usual, as a share of
    the deposit."""
    return path.unreached_volume / path.deposit_volume + _measure_badly_filled(path)


def _measure_steps(path: DepositPath) -> float:
    """As `measure_lost`, without what collides, is out of sight or stands on nothing: layers of another form would not
    reach that either, and to try them takes long."""
    thin = sum(item.volume for item in path.unreached if item.why in (SUNK, SHORT))
    return thin / path.deposit_volume + _measure_badly_filled(path)


def _measure_badly_filled(path: DepositPath) -> float:
    if path.fill is None:
        return 0.0
    return path.fill.gap / path.deposit_volume + max(path.fill.sunk / path.deposit_volume - MUCH_SUNK, 0.0)


def _measure_spill(path: DepositPath) -> float:
    """How far beads reach out of the deposit; 0 where they were not simulated."""
    return 0.0 if path.fill is None else path.fill.spill_distance
