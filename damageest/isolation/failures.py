"""Messages for the user about calls in a worker that ended without a value."""

from __future__ import annotations

import signal
from typing import Any

from damageest.errors import StageError
from damageest.isolation.limits import Limits, format_bytes

_NAMES = {
    "SIGSEGV": "a segmentation fault",
    "SIGABRT": "an abort",
    "SIGBUS": "a bus error",
    "SIGFPE": "an arithmetic error",
    "SIGILL": "an illegal instruction",
}
_SIGNALS = {int(getattr(signal, name)): text for name, text in _NAMES.items() if hasattr(signal, name)}

_CODES = {"time": "time_limit", "memory": "memory"}
"""Why a call gave no value, and the code of its error."""


class ProcessError(StageError):
    """A call in a worker that gave no value. ``why``: "time", "memory", "crash", or "exit" for sys.exit."""

    def __init__(self, why: str, message: str, remedy: str = "") -> None:
        self.why = why
        super().__init__(message, remedy, code=_CODES.get(why, "crash"))

    def __reduce__(self) -> tuple[Any, ...]:
        return ProcessError, (self.why, self.message, self.remedy), vars(self)


class RemoteTraceback(Exception):  # noqa: N818  (no error of its own: the cause of one, for --debug)
    """The traceback, or the output, of the process where an error arose."""

    def __str__(self) -> str:
        return "\n" + str(self.args[0])


def describe_end(status: int | None, output: str, memory: int, limits: Limits, owner: str) -> ProcessError:
    """The error for a process that gave no answer. ``status``: as of subprocess, None where it took too long."""
    if status is None:
        error = ProcessError(
            "time",
            f"was ended: not finished after {limits.seconds:g} s, the time limit of a {limits.of}",
            ", or ".join(part for part in (f"a longer {limits.option}", blame_authors(owner)) if part),
        )
    elif "bad_alloc" in output or "MemoryError" in output:
        error = describe_memory(memory, limits)
    elif status < 0:
        what, remedy = describe_signal(-status)
        error = ProcessError("crash", what, remedy or blame_authors(owner))
    else:
        error = ProcessError("crash", f"ended its process with exit status {status}", blame_authors(owner))
    error.__cause__ = RemoteTraceback(output) if output else None
    return error


def describe_signal(number: int) -> tuple[str, str]:
    """What a signal that ended a process means, and what to do where that is not for the authors of the code."""
    if number == getattr(signal, "SIGKILL", None):
        return (
            "its process was killed (SIGKILL), probably for want of memory",
            "a larger tolerance, fewer scan points, or a --memory that the machine has",
        )
    return f"its process ended by {_SIGNALS.get(number, 'a signal')} ({signal.Signals(number).name})", ""


def describe_memory(memory: int, limits: Limits) -> ProcessError:
    """The error for a process that ran out of the ``memory`` that it could allocate, in bytes."""
    most = f" than the {format_bytes(memory)} "
    most += "that --memory leaves it" if limits.memory is not None else "that were free"
    larger = "a larger --memory" if limits.memory is not None else "a machine with more memory"
    return ProcessError("memory", f"needed more memory{most}", f"a larger tolerance, fewer scan points, or {larger}")


def blame_authors(owner: str) -> str:
    return f"another implementation; report it to the authors of {owner}, with job and inputs" if owner else ""
