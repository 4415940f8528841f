"""`damageest machine`: machine files, for programs from deposition paths."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True, help="List, show and check machine files.")

AsJson = Annotated[bool, typer.Option("--json", help="Print one line of JSON on standard output, for programs.")]


@app.command("list")
def list_machines(as_json: AsJson = False) -> None:
    """List the machine files that the package brings."""
    from damageest.io.for_programs import format_json
    from damageest_machines.files import list_shipped, read_machine

    machines = {name: read_machine(file).name for name, file in list_shipped().items()}
    if as_json:
        typer.echo(format_json({"machines": [{"name": name, "title": title} for name, title in machines.items()]}))
        return
    for name, title in machines.items():
        typer.echo(f"{name:24} {title}")


@app.command("show")
def show_machine(
    name: Annotated[str, typer.Argument(help="Name that `damageest machine list` prints, or a file.")],
) -> None:
    """Print a machine file, to begin one of your own with."""
    from damageest_machines.files import find_file

    typer.echo(find_file(_find(name)).read_text(encoding="utf-8"), nl=False)


@app.command("schema")
def print_schema() -> None:
    """Print the JSON schema of machine files, for editors."""
    from damageest_machines.definition import Machine

    typer.echo(json.dumps(Machine.model_json_schema(), indent=2))


@app.command("check")
def check_machine(
    file: Annotated[str, typer.Argument(help="Machine file, or the name of one that the package brings.")],
) -> None:
    """Check a machine file, and name its kind of machine."""
    from damageest_machines.files import find_file, read_machine

    machine = read_machine(find_file(_find(file)))
    kind = "robot" if machine.robot else "machine tool"
    names = [*(axis.name for axis in machine.linear), *(axis.name for axis in machine.rotary)]
    axes = ", ".join(names) or "no axes of its own"
    typer.echo(f"{machine.name}: {kind}; {axes}; channels: {', '.join(machine.process.channels) or 'none'}")


def _find(name: str) -> Path | str:
    return Path(name) if Path(name).is_file() else name
