"""What else explains the scan: a part that was made thinner, where a loss is taken, and the other way round."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.stages.adapt._choose import BALANCE, Trial, explains_more
from damageest.stages.adapt._field import Field

TOLD = 0.5
"""Depth, in tolerances, from which what another field would do to the skin is told."""
OPEN = 2.5
"""What a field leaves in half of the patches, in mean squares of the noise, from which another may be as right."""
DECIDES = "name unworn faces in align.datum, or give a second part of its type"


class Thinned(NamedTuple):
    """Skin that one field has deeper in the part than another: its largest ``depth``, its ``area`` and ``volume``."""

    depth: float
    area: float
    volume: float


def find_other(trials: Sequence[Trial], chosen: Trial, noise: float) -> tuple[Trial | None, bool]:
    """The field that explains the scan better than the chosen one and was not taken, since it follows what is inward;
    and whether both are possible: it also explains metal that stands out, though not for certain, or the chosen one
    leaves much."""
    better = [one for one in trials if one is not chosen and explains_more(one.score.both, chosen.score.both)[0]]
    if not better:
        return None, False
    best = min(better, key=lambda one: float(one.score.both.mean()))
    gained = float((chosen.score.both - best.score.both).mean())
    outside = float((chosen.score.outside - best.score.outside).mean())
    leaves_much = bool(np.median(chosen.score.both) > OPEN * noise**2)
    return best, leaves_much or outside > BALANCE * gained


def find_thinned(skin: Mesh, field: Field, other: Field, tolerance: float) -> Thinned:
    """Where the other field has the ``skin`` deeper in the part than the field."""
    centres = skin.triangles.mean(axis=1)
    depth = -np.einsum("ij,ij->i", other.displace(centres) - field.displace(centres), skin.face_normals)
    area = skin.face_areas
    deep = depth > TOLD * tolerance
    return Thinned(float(depth.max(initial=0.0)), float(area[deep].sum()), float((area * depth)[deep].sum()))


def describe_other(thinned: Thinned, is_open: bool, unit: str) -> str:
    """What is said of a loss that a thinner part would look like."""
    words = (
        f"a part that was made up to {thinned.depth:.3g} {unit} thinner over {thinned.area:.3g} {unit}² "
        f"({thinned.volume:.3g} {unit}³) would look like loss there"
    )
    taken = "both volumes are in the intervals" if is_open else "treated as material loss: no matching bulge"
    return f"{words}: {taken}; {DECIDES}"


def describe_hidden(thinned: Thinned, unit: str) -> str:
    """What is said of skin that the field made thinner."""
    return (
        f"the adapted part is up to {thinned.depth:.3g} {unit} thinner over {thinned.area:.3g} {unit}² "
        f"({thinned.volume:.3g} {unit}³), which may hide wear; {DECIDES}"
    )


def measure_unknown(modes: Floats, normals: Floats) -> float:
    """The largest standard deviation of the skin's place along its normals (V,3), from independent errors (K,V,3)."""
    return float(np.sqrt((np.einsum("kvc,vc->kv", modes, normals) ** 2).sum(axis=0)).max(initial=0.0))


def describe_unknown(error: float, tolerance: float, unit: str) -> str:
    """What is said of skin that no point shows, and that the field does not predict."""
    return (
        f"unseen adapted skin is known within ±{2 * error:.3g} {unit} (95 %), tolerance {tolerance:.3g} {unit}; scan "
        "more beside it, or give a second part of its type"
    )
