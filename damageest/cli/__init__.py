"""The command line, with one module per command. Heavy imports are inside the commands, so that --help is quick."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from typing import NoReturn

import typer

from damageest import __version__
from damageest.cli import _interrupt, _process, _streams
from damageest.cli._commands import Commands
from damageest.cli._errors import describe_failure, say_error
from damageest.cli._json import say_json
from damageest.cli._streams import say
from damageest.errors import DamageestError, describe_missing_library, describe_shortage, is_interrupt
from damageest.io.files import working_folder
from damageest.isolation.one_thread import ONE_THREAD
from damageest.isolation.supervise import note_status

app = typer.Typer(
    name="damageest",
    cls=Commands,
    help="From a CAD part and a 3D scan of the damaged one to the watertight volume of the missing metal.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(requested: bool) -> None:
    if requested:
        say(f"damageest {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Show the version."),
) -> None:
    pass


def _add_commands() -> None:
    from damageest.cli import (
        batch,
        doctor,
        explain,
        faces,
        init,
        inspect,
        nominal,
        part,
        picture,
        plugins,
        run,
        schema,
        stages,
        validate,
        verify,
        view,
    )

    for module in (
        run,
        batch,
        view,
        picture,
        nominal,
        inspect,
        verify,
        validate,
        init,
        explain,
        doctor,
        faces,
        part,
        stages,
        plugins,
        schema,
    ):
        app.command(module.__name__.rsplit(".", 1)[1])(module.command)


_add_commands()


def main() -> None:
    """Runs the command line. Exit status 0: done; 1: a stage failed or refused; 2: the job or an input is not valid."""
    _process.is_command = True
    os.environ.update(ONE_THREAD)
    _interrupt.keep_interrupts()
    _streams.prepare()
    try:
        _call_app()
    except SystemExit as end:
        failure = _streams.describe_failure()
        if failure and not end.code:
            say(f"error: standard output cannot be written: {failure}; written files are complete", err=True)
            end.code = 1
        note_status(end.code)
        raise


def _call_app() -> NoReturn:
    """Runs the command that the arguments name, and ends with its exit status."""
    try:
        working_folder()  # where it was deleted, no path has a place
        app(prog_name="damageest")  # also where it is called by `python -m damageest`
        sys.exit(0)
    except SystemExit as end:
        if end.code == _interrupt.STATUS:  # typer turns KeyboardInterrupt into it
            _stop_interrupted()
        raise
    except DamageestError as error:
        fail(error)
    except KeyboardInterrupt:
        _stop_interrupted()
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(141)
    except Exception as error:
        if is_interrupt(error):
            _stop_interrupted()
        fail(describe_missing_library(error) or describe_shortage(error) or error)
    finally:
        _process.bound_end(sys.exc_info()[1])


def _stop_interrupted() -> NoReturn:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the second one, of who is impatient, changes nothing
    say(_interrupt.text, err=True)
    sys.exit(_interrupt.STATUS)


def fail(error: Exception) -> NoReturn:
    """Prints the error and exits with its status. With --debug, prints the traceback; with --json also the error as
    JSON on standard output."""
    if "--json" in sys.argv:
        say_json(describe_failure(error))
    if "--debug" in sys.argv:
        traceback.print_exception(error)
    else:
        say_error(error)
    sys.exit(getattr(error, "exit_status", 1))
