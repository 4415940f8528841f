"""`damageest evaluate`: how good the results are, over many cases with known truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damageest import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def damageest_commands(app: typer.Typer) -> None:
    """Adds `damageest evaluate`."""
    from damageest_evaluate.commands import evaluate

    app.add_typer(evaluate.app, name="evaluate")
