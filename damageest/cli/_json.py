"""The option --json, the same for all commands: one line on standard output, all else on standard error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from damageest.cli._streams import say_result

AsJson = Annotated[bool, typer.Option("--json", help="Print one line of JSON on standard output, for programs.")]


def say_json(content: Mapping[str, Any]) -> None:
    """Prints an object for programs, with the version of its schema."""
    from damageest.io.for_programs import format_json

    say_result(format_json(content))
