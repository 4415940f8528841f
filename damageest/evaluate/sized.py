"""Random damages of a given depth, repeatable from a seed."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Part
from damageest.errors import StageError
from damageest.evaluate.damages import KINDS, Damaged, DamagePlace
from damageest.evaluate.scores import depth
from damageest.stages.scan.scanner import apply_tools

SIZED = ("chip", "pit", "cut", "groove")
"""Kinds whose depth goes with their size; how deep the others go, the part decides."""
CLOSE = 0.05
"""By how much of it the depth may differ from the one asked for."""


def sized_damage(part: Part, seed: int, deep: float, first: str = SIZED[0]) -> Damaged:
    """One loss that reaches ``deep`` below the part's surface, of kind ``first`` where the part has a place for it.

    The same seed gives the same place and shape at every depth, as far as the part allows. Raises LookupError where
    none fits, as where the part's walls are thinner.
    """
    rng = np.random.default_rng([5381, seed])
    site = DamagePlace(part, rng)
    for attempt in range(24):
        name = first if attempt < 8 else str(rng.choice(SIZED))
        made = _scaled(site, name, deep)
        if made is not None:
            return made
    raise LookupError(f"no damage {deep:.4g} deep fits the part")


def _scaled(site: DamagePlace, name: str, deep: float) -> Damaged | None:
    """The next random loss of a kind, made larger or smaller until it is as deep as asked for; None if it cannot."""
    state = site.rng.bit_generator.state
    site.size = 20 * deep
    try:
        for _ in range(12):
            site.rng.bit_generator.state = state
            tools = KINDS[name](site)
            lost = apply_tools(site.part, tools)[1]
            reached = depth(lost, site.part) if lost else 0.0
            if lost is not None and abs(reached / deep - 1) < CLOSE:
                return Damaged(tuple(tools), (name,), lost)
            site.size *= float(np.clip(deep / max(reached, 1e-12), 0.3, 3))
            if site.size > 8 * site.part.diagonal:
                return None
    except (StageError, LookupError):
        return None
    return None
