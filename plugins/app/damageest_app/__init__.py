"""`damageest app`: open, run and judge jobs in the browser of this machine.

The app edits job files and runs them with `damageest run`. The hooks below are called in that process too, and say how
far it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damageest import hookimpl
from damageest_app.running import events

if TYPE_CHECKING:
    import typer


@hookimpl
def damageest_commands(app: typer.Typer) -> None:
    """Adds `damageest app`."""
    from damageest_app import command

    app.command("app")(command.command)


@hookimpl
def damageest_before_stage(stage: str, use: str, site: int) -> None:
    """Says which stage begins, in a run that the app has started."""
    events.tell("begin", stage=stage, use=use, site=site)


@hookimpl
def damageest_after_stage(stage: str, site: int, seconds: float, cached: bool) -> None:
    """Says which stage is done."""
    events.tell("end", stage=stage, site=site, seconds=seconds, cached=cached)


@hookimpl
def damageest_after_step(step: str, seconds: float) -> None:
    """Says which step between the stages is done."""
    events.tell("step", step=step, seconds=seconds)
