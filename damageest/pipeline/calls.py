"""Calls the code of an implementation, in a process of its own where its class says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from damageest.errors import InputError, StageError, clean_message
from damageest.isolation import Limits, ProcessError, at_work, call_isolated
from damageest.isolation.lost_threads import raise_lost
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
            return call_guarded(lambda: function(**arguments), owner)
    worker = f"{item.provider.module.partition('.')[0]} {item.provider.fingerprint}"
    if item.cls.reads:
        limits = replace(limits, seconds=limits.seconds * READERS_SHARE)
    try:
        with at_work(what, limits.seconds and limits.seconds + WAIT, owner):
            return call_guarded(
                lambda: call_isolated(function, arguments, worker=worker, owner=owner, limits=limits), owner
            )
    except ProcessError as error:
        if not item.cls.reads:
            raise
        raise InputError(
            f"{getattr(stage, 'path', item.contract.stage)}: the program that reads it "
            f"{clean_message(error.message)}\n  try: "
            f"export the file again, since it is damaged; or report it to the authors of {owner}"
        ) from error


def call_guarded(function: Callable[[], T], owner: str) -> T:
    """What a function of ``owner`` gives. An error of Python's that would end more than the stage, as SystemExit or
    GeneratorExit, becomes a StageError; Ctrl-C stays what it is."""
    try:
        with raise_lost():
            return function()
    except (Exception, KeyboardInterrupt):
        raise
    except SystemExit as end:
        what = f"called sys.exit({'' if end.code is None else clean_message(end.code, 200)})"
        raise StageError(f"{what}, which would end the run", _blame(owner), code="crash") from end
    except BaseException as end:
        what = f"raised {type(end).__name__}{f' ({clean_message(end, 400)})' if end.args else ''}"
        raise StageError(f"{what}, which would end the run", _blame(owner), code="crash") from end


def _blame(owner: str) -> str:
    return f"another implementation; report it to the authors of {owner}"
