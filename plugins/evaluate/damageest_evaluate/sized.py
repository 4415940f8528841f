"""Random damages of a given depth. Equal seeds give equal damages."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Part
from damageest.errors import StageError
from damageest.stages.scan.scanner import apply_tools
from damageest_evaluate.damages import KINDS, PlacePicker, RandomDamage
from damageest_evaluate.scores import measure_depth

SIZED = ("chip", "pit", "cut", "groove")
"""Kinds whose depth depends on their size. The depth of the other kinds depends on the part."""
DEPTH_ERROR = 0.05
"""Largest relative difference between the depth and the requested depth."""


def make_sized_damage(part: Part, seed: int, depth: float, first: str = SIZED[0]) -> RandomDamage:
    """One damage with a depth of ``depth`` below the part's surface, of kind ``first`` if the part has a place for it.

    The same seed gives the same place and shape at every depth, as far as the part allows. Raises LookupError if no
    damage fits, for example because the walls are thinner.
    """
    rng = np.random.default_rng([5381, seed])
    picker = PlacePicker(part, rng)
    for attempt in range(24):
        name = first if attempt < 8 else str(rng.choice(SIZED))
        damage = _scale_damage(picker, name, depth)
        if damage is not None:
            return damage
    raise LookupError(f"no damage with a depth of {depth:.4g} fits the part")


def _scale_damage(picker: PlacePicker, name: str, depth: float) -> RandomDamage | None:
    """The next random damage of a kind, scaled to the requested depth; None if it does not reach it."""
    state = picker.rng.bit_generator.state
    picker.size = 20 * depth
    try:
        for _ in range(12):
            picker.rng.bit_generator.state = state
            tools = KINDS[name](picker)
            volume = apply_tools(picker.part, tools)[1]
            reached = measure_depth(volume, picker.part) if volume else 0.0
            if volume is not None and abs(reached / depth - 1) < DEPTH_ERROR:
                return RandomDamage(tuple(tools), (name,), volume)
            picker.size *= float(np.clip(depth / max(reached, 1e-12), 0.3, 3))
            if picker.size > 8 * picker.part.diagonal:
                return None
    except (StageError, LookupError):
        return None
    return None
