"""How good are the results, over many cases? Suites and tables, for a clone of the repository: nothing here is shipped.

Parts of known shape (`parts.py`), troubles and draws are also what tests are made of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damageest import hookimpl

if TYPE_CHECKING:
    import typer


@hookimpl
def damageest_commands(app: typer.Typer) -> None:
    """Adds its commands to `damageest evaluate`, which damageest-evaluate brings."""
    import damageest_benchmarks.commands.evaluate  # noqa: F401  importing it adds them, once
