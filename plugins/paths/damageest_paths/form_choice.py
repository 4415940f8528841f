"""Chooses whether the layers of a deposit are planes, or surfaces along the floor of the cavity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

import numpy as np

from damageest.artefacts import DepositPath, Mesh, Solid
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.vectors import normalise
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
LITTLE = 0.025
"""Share of a thin shell that layers along the floor may lose where planes are not even planned, since they are so many
that they cost more."""

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
    piece = _measure_piece(draft)
    lost, surplus = draft.unreached_volume / draft.deposit_volume, 0.0
    if draft.fill is not None:
        lost += draft.fill.gap / draft.deposit_volume
        lost += max(draft.fill.sunk / draft.deposit_volume - MUCH_SUNK, 0.0)
        surplus = draft.fill.spill / draft.deposit_volume
    return Merit(LOST * lost, surplus, START * starts * piece, LAYER * layers * piece, (starts, layers))


def _measure_piece(draft: Draft) -> float:
    """The share of the deposit that a bead is which is as long as it is wide."""
    return draft.width**2 * max((plan.height for plan in draft.plans), default=0.0) / draft.deposit_volume


def bound_planes(draft: Draft) -> Merit:
    """What planes would cost at least, whatever their direction: with one start a layer, nothing lost or added."""
    count, piece = count_planes(draft.task.body, draft.process.height), _measure_piece(draft)
    return Merit(0.0, 0.0, START * count * piece, LAYER * count * piece, (count, count))


def count_planes(body: Solid, height: float) -> int:
    """The least number of layers in planes that build up a body, each of its pieces in the direction that takes the
    fewest: across a face of its hull."""
    pieces = to_manifold(body, body.bounds.mean(axis=0)).decompose()
    spans = [_measure_least_span(Mesh(*to_arrays(piece.hull()))) for piece in pieces]
    return sum(int(np.ceil(span / height - 1e-6)) for span in spans if span > height / 2)


def _measure_least_span(hull: Mesh) -> float:
    """The least extent of a convex mesh across one of its faces."""
    normals = np.unique(np.round(hull.face_normals, 2), axis=0)
    normals = normalise(normals[np.linalg.norm(normals, axis=1) > 0.5])
    return float(np.ptp(hull.vertices @ normals.T, axis=0).min())


class Plan(Protocol):
    """Gives the draft of a planner. ``along_normal``: where the job leaves the build direction to the planner, it is
    the mean normal of the open side, and no other is tried."""

    def __call__(self, planner: Planner, along_normal: bool = False) -> Draft: ...


def plan_in_form(form: Form, plan: Plan, is_shell: bool = False, is_sink_given: bool = False) -> Draft:
    """The draft of a form. ``auto``: planes; where they lose much of the deposit because they are planes, as of the
    crescent of a worn bore, surfaces along the floor if these lose half of all that planes lose, or less.

    ``is_shell``: for ``auto``, whether planes would be so many that surfaces along the floor are tried first; planes
    are not planned where these lose little, and cost less than planes at least. ``is_sink_given``: whether the job says
    how deep beads may lie in intact metal.
    """
    if form == "conformal":
        return replace(plan(PLANNERS[form]), layer_form=form)
    along = _plan_along(plan) if is_shell else None
    if along is not None and _is_clearly_cheaper(along):
        return replace(along, why=_describe(bound_planes(along), along, "at least "))
    planar = plan(PLANNERS["planar"])
    why = ""
    is_poor = _measure_steps(planar) > POOR
    if form == "auto" and (is_poor or along is not None or _has_many_layers(planar)):
        along = along or _plan_along(plan)
        spilt = max(FARTHEST * planar.width, _measure_spill(planar))
        costs = measure_merit(planar), measure_merit(along)
        is_better = is_poor and measure_lost(along) <= GAIN * measure_lost(planar)
        is_better |= costs[1].cost < CHEAPER * costs[0].cost and measure_lost(along) <= measure_lost(planar)
        if not along.is_empty:
            why = _describe(costs[0], along)
        if not along.is_empty and is_better and _measure_spill(along) <= spilt:
            return replace(along, why=why)
    planar = replace(planar, why=why)
    return replace(planar if is_sink_given else _spare_metal(planar, plan), layer_form="planar")


def _plan_along(plan: Plan) -> Draft:
    return replace(plan(PLANNERS["conformal"], along_normal=True), layer_form="conformal")


def _is_clearly_cheaper(along: Draft) -> bool:
    """Whether layers along the floor lose little, and cost less than planes at least would, which lose nothing."""
    if along.is_empty or measure_lost(along) > LITTLE or _measure_spill(along) > FARTHEST * along.width:
        return False
    return measure_merit(along).cost < bound_planes(along).cost


def _describe(planes: Merit, along: Draft, least: str = "") -> str:
    floor = measure_merit(along).describe()
    return f"cost beyond the beads: in planes {least}{planes.describe()}, along the floor {floor}"


def is_thin_shell(body: Solid, height: float) -> bool:
    """Whether layers in planes would be `MANY` times as many as layers along the floor, whatever their direction."""
    return count_planes(body, height) >= MANY * _count_along(body, height)


def _has_many_layers(planar: Draft) -> bool:
    """The same of planes that are planned."""
    return measure_merit(planar).counts[1] >= MANY * _count_along(planar.task.body, planar.process.height)


def _count_along(body: Solid, height: float) -> int:
    """The number of layers along the floor of a shell."""
    return int(np.ceil(2 * body.volume / body.area / height))


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
