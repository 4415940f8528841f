"""Errors of stages with their place: the stage, the implementation, the site or where its points lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import ArtefactError, Scan, Sites
from damageest.errors import (
    DamageestError,
    InputError,
    JobError,
    StageError,
    clean_message,
    describe_missing_library,
    describe_shortage,
)
from damageest.pipeline.cache import describe_unwritable
from damageest.pipeline.state import Candidate, FoundSite, JobState
from damageest.registry.registry import Implementation

READERS = {"part": "part_file", "scan": "scan_file"}
"""Stages that read files, and the code of an error for one that cannot be used."""


def locate_error(error: Exception, item: Implementation, state: JobState | Candidate | FoundSite) -> DamageestError:
    """The error with the stage it came from. One of another kind becomes a StageError that names the provider."""
    stage = item.contract.stage
    if isinstance(error, JobError):
        return error
    if isinstance(error, DamageestError) and not isinstance(error, StageError):
        error.args = (clean_message(error),)
        if error.code == "input" and stage in READERS:
            error.code = READERS[stage]
        return error
    if not isinstance(error, StageError) and (missing := describe_missing_library(error)):
        error = missing
    if isinstance(error, OSError) and stage in ("part", "scan"):
        return InputError(f"{stage}: {item.name}: {clean_message(error)}", code=READERS[stage])
    if isinstance(error, OSError) and stage in ("export", "report") and error.errno:
        return describe_unwritable(error, Path("the output"))
    placed = error if isinstance(error, StageError) else _explain(error, f"{item.provider}")
    placed.message, placed.remedy = clean_message(placed.message), clean_message(placed.remedy)
    placed.stage, placed.use, placed.site = stage, item.name, state.number
    if isinstance(state, Candidate) and {"sites", "aligned"} <= set(state.job.values):
        placed.place = describe_points(state.job.sites, state.job.aligned, state.clusters)
    return placed


def describe_points(sites: Sites, aligned: Scan, clusters: tuple[int, ...]) -> str:
    """A description of where the points of some clusters lie: they have no site number, since they are no site yet."""
    members = np.flatnonzero(np.isin(sites.label, clusters))
    if not len(members):
        return "no points"
    x, y, z = np.median(aligned.points[members], axis=0)
    return f"{len(members)} points near ({x:.4g}, {y:.4g}, {z:.4g})"


def _explain(error: Exception, provider: str) -> StageError:
    """An error that a stage did not raise on purpose, in words for the user and the author."""
    first = next(iter(clean_message(error, 400).splitlines()), "")
    if short := describe_shortage(error):
        return short
    if isinstance(error, ArtefactError):
        return StageError(
            f"gave a result that is not valid: {first}",
            f"another implementation; report it to the authors of {provider}",
            code="faulty",
        )
    if isinstance(error, ValueError) and "read-only" in first:
        return StageError(
            f"tried to edit what it was given, which later stages use as well ({first})",
            f"another implementation; the authors of {provider} should edit a copy",
            code="faulty",
        )
    return StageError(
        f"failed unexpectedly: {type(error).__name__}: {first}",
        f"--debug for the traceback; report it to the authors of {provider}, with job and inputs",
        code="faulty",
    )
