"""Chooses whether the layers of a deposit are planes, or surfaces along the floor of the cavity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

import numpy as np

from damageest.artefacts import DepositPath
from damageest_paths.drafts import MUCH_SUNK, Draft
from damageest_paths.layering.conformal import plan_conformal
from damageest_paths.layering.directions import Planner
from damageest_paths.layering.planar import SHORT, SUNK, Surroundings, plan_planar
from damageest_paths.process.frames import Frame
from damageest_paths.process.process import Plan as LayerPlan
from damageest_paths.process.process import Process

Form = Literal["auto", "planar", "conformal"]
PLANNERS: dict[str, Planner] = {"planar": plan_planar, "conformal": plan_conformal}
POOR = 0.07
"""Share of a deposit that planes lose as planes from which surfaces along the floor are tried. Rough losses lose 2 to
7 % of themselves to the stair-step of planes beside leaning walls."""
GAIN = 0.5
"""Share of what planes lose that these may lose."""
MANY, CHEAPER = 5.0, 0.7
"""How many times as many layers in planes as along the floor are tried against each other; and the share of the cost of
planes, see `Merit`, at which those along the floor are taken if they lose no more."""
FARTHEST = 1.1
"""Bead widths by which beads may reach out of the deposit, or as far as those of planes do."""
SPARING = (0.4, 0.3)
"""Shares of a layer's height to which beads may lie in intact metal, in turn, where else too much of them does."""
MOST_LEFT = 0.03
"""Share of the deposit that may be left unfilled for that."""

LOST, START, LAYER = 3.0, 8.0, 20.0
"""What a share that is lost costs, in shares of surplus; and the bead widths of way that a start, and a layer, cost."""


@dataclass(frozen=True)
class Merit:
    """Terms in shares of the deposit; less is better. ``lost``: what is not filled, and what of the beads lies in
    metal beyond what is usual; ``surplus``: what they add beside the deposit; ``starts``, ``layers``: what they cost as
    much as so much of bead."""

    lost: float
    surplus: float
    starts: float
    layers: float
    counts: tuple[int, int]

    @property
    def cost(self) -> float:
        return self.lost + self.surplus + self.starts + self.layers

    def describe(self) -> str:
        """The figure and its terms."""
        starts, layers = self.counts
        return (
            f"{self.cost:.2f} (lost {self.lost:.2f}, surplus {self.surplus:.2f}, {starts} starts {self.starts:.2f}, "
            f"{layers} layers {self.layers:.2f})"
        )


def measure_merit(draft: Draft) -> Merit:
    """The merit of a draft; its surplus counts where its beads were simulated."""
    starts = sum(map(len, draft.groups))
    layers = len({(number, one.layer) for number, group in enumerate(draft.groups) for one in group})
    piece = draft.width**2 * max((plan.height for plan in draft.plans), default=0.0) / draft.deposit_volume
    lost, surplus = draft.unreached_volume / draft.deposit_volume, 0.0
    if draft.fill is not None:
        lost += draft.fill.gap / draft.deposit_volume
        lost += max(draft.fill.sunk / draft.deposit_volume - MUCH_SUNK, 0.0)
        surplus = draft.fill.spill / draft.deposit_volume
    return Merit(LOST * lost, surplus, START * starts * piece, LAYER * layers * piece, (starts, layers))


class Plan(Protocol):
    """Gives the draft of a planner. ``along_normal``: where the job leaves the build direction to the planner, it is
    the mean normal of the open side, and no other is tried."""

    def __call__(self, planner: Planner, along_normal: bool = False) -> Draft: ...


def plan_in_form(form: Form, plan: Plan, is_sink_given: bool = False) -> Draft:
    """The draft of a form. ``auto``: planes; where they lose much of the deposit because they are planes, as of the
    crescent of a worn bore, surfaces along the floor if these lose half of all that planes lose, or less.

    ``is_sink_given``: whether the job says how deep beads may lie in intact metal.
    """
    if form == "conformal":
        return replace(plan(PLANNERS[form]), layer_form=form)
    planar = plan(PLANNERS["planar"])
    why = ""
    is_poor = _measure_steps(planar) > POOR
    if form == "auto" and (is_poor or _has_many_layers(planar)):
        conformal = replace(plan(PLANNERS["conformal"], along_normal=True), layer_form="conformal")
        spilt = max(FARTHEST * planar.width, _measure_spill(planar))
        costs = measure_merit(planar), measure_merit(conformal)
        is_better = is_poor and measure_lost(conformal) <= GAIN * measure_lost(planar)
        is_better |= costs[1].cost < CHEAPER * costs[0].cost and measure_lost(conformal) <= measure_lost(planar)
        if not conformal.is_empty:
            why = f"cost beyond the beads: in planes {costs[0].describe()}, along the floor {costs[1].describe()}"
        if not conformal.is_empty and is_better and _measure_spill(conformal) <= spilt:
            return replace(conformal, why=why)
    planar = replace(planar, why=why)
    return replace(planar if is_sink_given else _spare_metal(planar, plan), layer_form="planar")


def _has_many_layers(planar: Draft) -> bool:
    """Whether a deposit is a thin shell whose planes are many more than layers along its floor would be."""
    thick = 2 * planar.deposit_volume / planar.task.body.area
    along = int(np.ceil(thick / planar.process.height))
    return measure_merit(planar).counts[1] >= MANY * along


def _spare_metal(planar: Draft, plan: Plan) -> Draft:
    """The draft in planes; where much of its beads lies in intact metal, one of which less does, if that leaves little
    of the deposit unfilled."""
    if _measure_sunk(planar) <= MUCH_SUNK:
        return planar
    for share in SPARING:
        sparing = plan(_make_sparing(share))
        left = (sparing.unreached_volume - planar.unreached_volume) / planar.deposit_volume
        if sparing.is_empty or left > MOST_LEFT:
            break
        if _measure_sunk(sparing) <= MUCH_SUNK:
            return sparing
    return planar


def _make_sparing(share: float) -> Planner:
    """The planner of planes with beads that lie no deeper in intact metal than a share of the layer's height."""

    def plan(body: Any, frame: Frame, around: Surroundings, process: Process) -> LayerPlan:
        return plan_planar(body, frame, around, replace(process, sink_share=share))

    return plan


def measure_lost(path: Draft | DepositPath) -> float:
    """What of the deposit is not filled, and what of the beads lies in intact metal beyond what is usual, as a share of
    the deposit."""
    return path.unreached_volume / path.deposit_volume + _measure_badly_filled(path)


def _measure_steps(path: Draft | DepositPath) -> float:
    """As `measure_lost`, without what collides, is out of sight or stands on nothing: layers of another form would not
    reach that either, and to try them takes long."""
    thin = sum(item.volume for item in path.unreached if item.why in (SUNK, SHORT))
    return thin / path.deposit_volume + _measure_badly_filled(path)


def _measure_badly_filled(path: Draft | DepositPath) -> float:
    if path.fill is None:
        return 0.0
    return path.fill.gap / path.deposit_volume + max(_measure_sunk(path) - MUCH_SUNK, 0.0)


def _measure_sunk(path: Draft | DepositPath) -> float:
    """The volume of beads in intact metal, as a share of the deposit; 0 where they were not simulated."""
    return 0.0 if path.fill is None else path.fill.sunk / path.deposit_volume


def _measure_spill(path: Draft | DepositPath) -> float:
    """How far beads reach out of the deposit; 0 where they were not simulated."""
    return 0.0 if path.fill is None else path.fill.spill_distance
