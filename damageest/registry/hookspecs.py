"""The hooks a plugin may implement: eight that add, five that only observe.

What is computed is decided by the job file alone, so a result can be reproduced from it: observers get values, and
what they return is ignored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import pluggy

if TYPE_CHECKING:
    import typer

    from damageest.artefacts import Floats
    from damageest.result import Conversion
    from damageest.rules import Rule, Term
    from damageest.stages import Stage
    from damageest.stages.export import PathWriter, Writer

hookspec = pluggy.HookspecMarker("damageest")
hookimpl = pluggy.HookimplMarker("damageest")


@hookspec
def damageest_stages() -> Sequence[type[Stage]]:  # type: ignore[empty-body]
    """Gives the stage implementations that this plugin provides: classes derived from a contract."""


@hookspec
def damageest_writers() -> Mapping[str, Writer]:  # type: ignore[empty-body]
    """Gives the file formats that this plugin can write, by the name, which is also the suffix, that a job's
    `export: {format: ...}` calls them by."""


@hookspec
def damageest_path_writers() -> Mapping[str, PathWriter]:  # type: ignore[empty-body]
    """Gives the formats of deposition paths that this plugin can write, by the name that a job's
    `export: {paths: ...}` calls them by."""


@hookspec(firstresult=True)
def damageest_kinematics(machine: str, poses: Floats, turns: Floats) -> Floats | None:
    """Gives the joints (N,J), in degrees, at which the robot that a machine file calls by this name has its flange at
    each of the poses (N,4,4), in mm and in its base's frame, with its positioner at ``turns`` (N,E), in degrees; NaN in
    the row of a pose that it cannot take. None for a robot that it does not know."""


@hookspec
def damageest_conversions() -> Mapping[str, Conversion]:  # type: ignore[empty-body]
    """Gives the conversions of results by this plugin, by the name for `Result.convert`. The function gets the result,
    what of it ("damage"), and the number of a site or None."""


@hookspec
def damageest_rules() -> Sequence[type[Rule]]:  # type: ignore[empty-body]
    """Gives the rules that this plugin adds: each looks at the facts about a site and gives reasons for its verdict."""


@hookspec
def damageest_terms() -> Sequence[type[Term]]:  # type: ignore[empty-body]
    """Gives the terms that this plugin adds to the intervals: each measures what a source of uncertainty makes of a
    volume."""


@hookspec
def damageest_commands(app: typer.Typer) -> None:
    """Adds commands to the command line. Called for a command that is not built in, and for ``--help``: import what
    is large inside the commands. A built-in command of the same name stays."""


@hookspec
def damageest_before_stage(stage: str, use: str, site: int) -> None:
    """Called before a stage runs; ``site`` counts from 1 and is 0 for a stage that runs once per job."""


@hookspec
def damageest_part_begins(stage: str, use: str, site: int, what: str) -> None:
    """Called when a stage names the part of its work that begins; few do. ``what``: text for a person."""


@hookspec
def damageest_after_stage(stage: str, use: str, site: int, output: object, seconds: float, cached: bool) -> None:
    """Called after a stage gave ``output`` (a read-only artefact); ``cached``: taken from an earlier run."""


@hookspec
def damageest_stage_failed(stage: str, use: str, site: int, error: Exception) -> None:
    """Called when a stage raised."""


@hookspec
def damageest_after_step(step: str, seconds: float) -> None:
    """Called after a step between the stages; ``seconds``: without those of stages it called."""
