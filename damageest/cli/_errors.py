"""How the command line says what went wrong: in one way for all commands, with the page of the documentation."""

from __future__ import annotations

from damageest.cli._streams import say
from damageest.errors import DamageestError, clean_message


def say_error(error: BaseException) -> None:
    """Prints an error on standard error, and where to read more about it."""
    if isinstance(error, DamageestError):
        say(f"error: {error}", err=True)
    else:
        say(
            f"error: unexpected {type(error).__name__}: {clean_message(error)}\n"
            "  try: add --debug to see the traceback",
            err=True,
        )
    say_help(error)


def say_help(error: BaseException) -> None:
    """Prints where to read more about an error. Without the libraries that this needs, as numpy, nothing is printed:
    the error is that they are missing then."""
    try:
        from damageest.error_codes import describe_help
    except ImportError:
        return
    say(describe_help(error), err=True)


def describe_failure(error: BaseException, source: str = "") -> dict[str, object]:
    """An error for programs, as a command with --json prints it."""
    from damageest.error_codes import find_page, name_code

    status = int(getattr(error, "exit_status", 1))
    said = {"job": source} if source else {}
    return {"status": "failed", **said, "exit": status, "error": str(error), "code": name_code(error),
            "page": find_page(error)}  # fmt: skip
