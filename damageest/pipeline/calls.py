"""Calls the code of an implementation, in a process of its own where its class says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from damageest.errors import InputError, StageError
from damageest.isolation import Limits, ProcessError, at_work, call_isolated
from damageest.registry.registry import Implementation
from damageest.stages import Stage

T = TypeVar("T")
READERS_SHARE = 1 / 6
"""Share of the time limit of a stage that a reader has."""
WAIT = 300.0
"""Seconds beyond the time limit of an isolated call until the process that waits for it counts as hung."""


def run_stage(stage: Stage, item: Implementation, arguments: Mapping[str, Any], limits: Limits, number: int = 0) -> Any:
    """What a stage gives. ``number``: of its site, 0 for the job.

    Raises what it raises, StageError where it exits, crashes or passes a limit, and InputError for a reader.
    """
    run: Callable[..., Any] = stage.run  # type: ignore[attr-defined]
    return call_implementation(run, arguments, stage, item, limits, number)


def call_implementation(
    function: Callable[..., T],
    arguments: Mapping[str, Any],
    stage: Stage,
    item: Implementation,
    limits: Limits,
    number: int = 0,
) -> T:
    """As `run_stage`, for any method of the stage."""
    what = f"{item.contract.stage}: {item.name}" + (f" (site {number})" if number else "")
    owner = f"{item.provider}"
    if not item.cls.isolated:
        with at_work(what, limits.seconds, owner):
            return _call_here(function, arguments, owner)
    worker = f"{item.provider.module.partition('.')[0]} {item.provider.fingerprint}"
    if item.cls.reads:
        limits = replace(limits, seconds=limits.seconds * READERS_SHARE)
    try:
        with at_work(what, limits.seconds and limits.seconds + WAIT, owner):
            return call_isolated(function, arguments, worker=worker, owner=owner, limits=limits)
    except ProcessError as error:
        if not item.cls.reads:
            raise
        raise InputError(
            f"{getattr(stage, 'path', item.contract.stage)}: the program that reads it {error.message}\n  try: "
            f"export the file again, since it is damaged; or report it to the authors of {owner}"
        ) from error


def _call_here(function: Callable[..., T], arguments: Mapping[str, Any], owner: str) -> T:
    try:
        return function(**arguments)
    except SystemExit as end:
        raise StageError(
            f"called sys.exit({'' if end.code is None else end.code}), which would end the run",
            f"another implementation; report it to the authors of {owner}",
        ) from end
