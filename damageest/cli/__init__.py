"""The command line. One file per command; each imports what it needs when it is called, so that --help is quick."""

from __future__ import annotations

import sys
import traceback

import typer

from damageest import __version__
from damageest.errors import DamageestError

app = typer.Typer(
    name="damageest",
    help="From a CAD part and a 3D scan of the damaged one to the watertight volume of the missing metal.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"damageest {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Show the version."),
) -> None:
    pass


def _commands() -> None:
    from damageest.cli import evaluate, faces, init, plugins, run, schema, stages, validate

    for module in (run, validate, init, faces, stages, plugins, schema):
        app.command(module.__name__.rsplit(".", 1)[1])(module.command)
    app.add_typer(evaluate.app, name="evaluate")


_commands()


def main() -> None:
    """Runs the command line; exit status 0 done, 1 a stage failed or refused, 2 the job or an input is at fault."""
    own = {command.name for command in app.registered_commands} | {group.name for group in app.registered_groups}
    word = next((argument for argument in sys.argv[1:] if not argument.startswith("-")), "")
    try:
        if word not in own:
            _plugin_commands()
        app()
    except DamageestError as error:
        fail(error)
    except KeyboardInterrupt:
        typer.echo("interrupted; finished stages are kept, the same command goes on from there", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(141)
    except Exception as error:
        fail(error)


def fail(error: Exception) -> None:
    """Says what went wrong in a few lines and exits; the traceback shows with --debug."""
    if "--debug" in sys.argv:
        traceback.print_exception(error)
    elif isinstance(error, DamageestError):
        typer.echo(f"error: {error}", err=True)
    else:
        typer.echo(f"error: unexpected {type(error).__name__}: {error}\n  try: --debug for the traceback", err=True)
    sys.exit(getattr(error, "exit_status", 1))


def _plugin_commands() -> None:
    """Lets plugins add their commands. Only done where a built-in command does not answer."""
    from damageest.registry.loading import load

    load()[0].hook.damageest_commands(app=app)
