"""Sites that bound a loss only together: the two faces of a ring's missing piece, the walls of a cut through a web."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from damageest.artefacts import Rims, Surface
from damageest.cache import digest
from damageest.engine import Engine, State
from damageest.errors import StageError
from damageest.stages.background import Background
from damageest.stages.enclose import Enclose, NotSeparatedError

MOST_PAIRED = 8
"""Sites up to which every pair is tried where all together do not do."""


def enclosed(engine: Engine, lanes: list[State]) -> list[State]:
    """Background and enclosure of each site; those that separate nothing alone are tried all together, then by pairs.

    A middle piece broken out leaves two damage surfaces, neither of which cuts anything off.
    """
    ahead: list[State] = []
    alone: dict[State, StageError] = {}
    for lane in lanes:
        try:
            ahead.append(_enclose(engine, lane))
        except NotSeparatedError as error:
            alone[lane] = error
        except StageError as error:
            engine.failures.append(error)
    groups: list[Sequence[State]] = [tuple(alone)] if len(alone) > 1 else []
    if 2 < len(alone) <= MOST_PAIRED:
        groups += combinations(alone, 2)
    for group in groups:
        if not all(lane in alone for lane in group):
            continue
        try:
            ahead.append(_enclose(engine, joined(group)))
        except StageError:
            continue
        for lane in group:
            del alone[lane]
    engine.failures += alone.values()
    return ahead


def _enclose(engine: Engine, lane: State) -> State:
    return engine.call(Enclose, engine.call(Background, lane))


def joined(lanes: Sequence[State]) -> State:
    """One lane, with the number of the first, for the sites of several: their surfaces, rims and points together."""
    surfaces = [lane["surface"] for lane in lanes]
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])[:-1]
    surface = Surface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([surface.faces + start for surface, start in zip(surfaces, starts, strict=True)]),
    )
    loops = [loop + start for lane, start in zip(lanes, starts, strict=True) for loop in lane["rims"].loops]
    values = {
        "surface": surface,
        "rims": Rims(tuple(sorted(loops, key=len, reverse=True))),
        "points": np.concatenate([lane["points"] for lane in lanes]),
        "clusters": tuple(cluster for lane in lanes for cluster in lane["clusters"]),
    }
    whole = lanes[0]
    for name, value in values.items():
        whole = whole.add(name, value, digest("together", name, [lane.keys[name] for lane in lanes]))
    return whole
