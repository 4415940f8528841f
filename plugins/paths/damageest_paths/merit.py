"""What a path costs beyond its beads: one figure by which layers in planes and along the floor are compared."""

from __future__ import annotations

from dataclasses import dataclass

from damageest_paths.drafts import MUCH_SUNK, Draft

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
