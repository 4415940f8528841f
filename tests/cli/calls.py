"""Commands called in the process of the tests."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError


def call(*words: str | Path) -> tuple[int, str]:
    """Exit status and all output of a command in this process."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(done.exception, DamageestError):  # `main` prints it
        return done.exception.exit_status, f"{done.output}error: {done.exception}"
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.output
