"""The step for sites that bound a loss only together: the two faces of a ring's missing piece, the walls of a cut
through a web."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from damageest.artefacts import Rims, Surface
from damageest.errors import StageError
from damageest.geometry.solids import concatenate_meshes
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import Candidate, Failures, JobState
from damageest.pipeline.steps import step
from damageest.stages.background import Background
from damageest.stages.enclose import Enclose, NotSeparatedError

MOST_PAIRED = 8
"""Candidates up to which each pair is tried where all together do not separate anything."""


@step(gives=("candidates", "failures"), reads=("candidates", "aligned", "sites"), calls=(Background, Enclose))
def enclose_grouped(engine: Engine, state: JobState) -> tuple[tuple[Candidate, ...], Failures]:
    """Encloses each candidate; those that separate nothing alone are tried all together, then in pairs.

    A middle piece broken out leaves two damage surfaces, neither of which cuts anything off.
    """

    def call(candidate: Candidate) -> Candidate:
        return engine.call(Enclose, engine.call(Background, replace(candidate, job=state)))

    done: list[Candidate] = []
    alone: dict[Candidate, StageError] = {}
    failures: list[StageError] = []
    for candidate in state.candidates:
        try:
            done.append(call(candidate))
        except NotSeparatedError as error:
            alone[candidate] = error
        except StageError as error:
            failures.append(error)
    groups: list[Sequence[Candidate]] = [tuple(alone)] if len(alone) > 1 else []
    if 2 < len(alone) <= MOST_PAIRED:
        groups += combinations(alone, 2)
    for group in groups:
        if not all(candidate in alone for candidate in group):
            continue
        try:
            done.append(call(join_candidates(group)))
        except StageError:
            continue
        for candidate in group:
            del alone[candidate]
    return tuple(done), [*failures, *alone.values()]


def join_candidates(group: Sequence[Candidate]) -> Candidate:
    """One candidate, with the number of the first, for several: their surfaces, rims and points together."""
    surfaces = [candidate.surface for candidate in group]
    vertices, faces, _ = concatenate_meshes(surfaces)
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])[:-1]
    loops = [loop + start for one, start in zip(group, starts, strict=True) for loop in one.rims.loops]
    whole = replace(group[0], clusters=tuple(cluster for candidate in group for cluster in candidate.clusters))
    whole = whole.with_value(Candidate.surface, Surface(vertices, faces))
    whole = whole.with_value(Candidate.rims, Rims(tuple(sorted(loops, key=len, reverse=True))))
    return whole.with_value(Candidate.points, np.concatenate([candidate.points for candidate in group]))
