"""`damageest evaluate job`: which damage is found, and how well, on a part and by a scanner of the user's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damageest import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def damageest_commands(app: typer.Typer) -> None:
    """Adds `damageest evaluate`."""
    from damageest_evaluate.commands import job

    app.add_typer(job.app, name="evaluate")
