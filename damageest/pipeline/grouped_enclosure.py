"""The step for sites that bound a loss only together: the two faces of a ring's missing piece, the walls of a cut
through a web."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from damageest.artefacts import Rims, Surface
from damageest.errors import StageError
from damageest.geometry.solids import concatenate_meshes
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Step
from damageest.pipeline.state import Candidate, Value, Work
from damageest.registry.contracts import Contract
from damageest.stages.enclose import NotSeparatedError

MOST_PAIRED = 8
"""Candidates up to which each pair is tried where all together do not separate anything."""


def enclose_grouped(background: Contract, enclose: Contract) -> Step:
    """A step that calls both contracts on each candidate; candidates that separate nothing alone are tried all
    together, then in pairs.

    A middle piece broken out leaves two damage surfaces, neither of which cuts anything off.
    """

    def call(engine: Engine, candidate: Candidate) -> Candidate:
        return engine.call(enclose, engine.call(background, candidate))

    def run(engine: Engine, work: Work) -> Work:
        done: list[Candidate] = []
        alone: dict[Candidate, StageError] = {}
        failures: list[StageError] = []
        for candidate in work.candidates:
            try:
                done.append(call(engine, candidate))
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
                done.append(call(engine, join_candidates(group)))
            except StageError:
                continue
            for candidate in group:
                del alone[candidate]
        return replace(work, candidates=tuple(done), failures=(*work.failures, *failures, *alone.values()))

    return run


def join_candidates(group: Sequence[Candidate]) -> Candidate:
    """One candidate, with the number of the first, for several: their surfaces, rims and points together."""
    surfaces = [candidate.surface for candidate in group]
    vertices, faces, _ = concatenate_meshes(surfaces)
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])[:-1]
    loops = [loop + start for one, start in zip(group, starts, strict=True) for loop in one.rims.loops]
    values: tuple[tuple[Value[Any], Any], ...] = (
        (Candidate.surface, Surface(vertices, faces)),
        (Candidate.rims, Rims(tuple(sorted(loops, key=len, reverse=True)))),
        (Candidate.points, np.concatenate([candidate.points for candidate in group])),
    )
    whole = replace(group[0], clusters=tuple(cluster for candidate in group for cluster in candidate.clusters))
    for value, content in values:
        key = digest("joined", value.name, [candidate.key(value.name) for candidate in group])
        whole = whole.with_value(value, content, key)
    return whole
