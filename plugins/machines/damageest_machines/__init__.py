"""Programs for robots and machine tools from deposition paths, by a machine file that says what the machine can do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from damageest import hookimpl

if TYPE_CHECKING:
    import typer

    from damageest.stages.export import PathWriter


@hookimpl
def damageest_path_writers() -> Mapping[str, PathWriter]:
    """A writer for each control, by the name that a job's `export: {paths: ...}` calls it by. Imported when it
    writes."""
    from damageest_machines.lazy import list_writers

    return list_writers()


@hookimpl
def damageest_commands(app: typer.Typer) -> None:
    """Adds `damageest machine`."""
    from damageest_machines.commands import machine

    app.add_typer(machine.app, name="machine")
