"""Pores: closed inner surfaces that do not reach the skin, as tomography shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Ints, Solid, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import Candidate, Failures, FoundSite, JobState
from damageest.stages.boundary import Boundary
from damageest.stages.reconstruct import Reconstruct
from damageest.trust.evidence import weigh_evidence

PORE = "pore"
"""The method of a site that is a pore."""
DEEP = 2.0
"""Depth in tolerances, and in point spacings, below which all of a pore lies."""


def add_pores(engine: Engine, state: JobState, found: tuple[FoundSite, ...]) -> tuple[tuple[FoundSite, ...], Failures]:
    """Makes a site of each cluster without a rim whose inner surface is closed and lies well inside the metal.

    It counts as lost metal. It is never deposited: nothing could reach it.
    """
    pores, kept = [], []
    for error in state.failures:
        pore = _make_pore(engine, state, error.site) if error.stage == Boundary.stage and error.site else None
        if pore is None:
            kept.append(error)
        else:
            pores.append(pore)
    return (*found, *pores), tuple(kept)


def _make_pore(engine: Engine, state: JobState, number: int) -> FoundSite | None:
    """The site of a cluster that is a pore; None where its points lie near the skin, or bound no volume."""
    field, members = state.field, state.sites.members(number)
    points = field.points[members]
    least = DEEP * max(field.tolerance, field.aligned.spacing)
    if -float(field.distance[members].max()) < least:
        return None
    candidate = Candidate(number=number, clusters=(number,), method=PORE)
    candidate = candidate.with_value(Candidate.points, points).with_value(Candidate.fine, True)
    try:
        surface = engine.call(Reconstruct, replace(candidate, job=state)).surface
    except StageError:
        return None
    solid = _close(surface)
    if solid is None:
        return None
    below = -float(signed_distance(solid.vertices, field.part)[0].max())
    evidence = weigh_evidence(solid, points, field)
    note = (
        f"a closed pore at least {below:.3g} {state.unit} below the skin; it counts as lost, but is in no deposit or "
        "path; mill down to it to fill it"
    )
    site = FoundSite(clusters=(number,), method=PORE, members=members, evidence=evidence, notes=(note,))
    return site.with_value(FoundSite.damage, solid)


def _close(surface: Surface) -> Solid | None:
    """The volume within a closed surface, whichever way it faces; None where it is open."""
    faces: Ints = surface.faces
    if not len(faces) or open_edges(faces):
        return None
    for turned in (faces, faces[:, ::-1]):
        try:
            return Solid(surface.vertices, np.ascontiguousarray(turned))
        except ValueError:
            continue
    return None
