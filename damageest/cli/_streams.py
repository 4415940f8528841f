"""What the command line prints: no text, terminal or full disk ends a run, and what is for programs stays clean."""

from __future__ import annotations

import codecs
import contextlib
import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from damageest.errors import clean_message

MOST_SHOWN = 20_000
"""Characters of one message on standard error that are shown."""
_PLAIN = {"²": "2", "³": "3", "–": "-", "−": "-", "±": "+-", "µ": "u", "λ": "lambda", "×": "x", "→": "->", "…": "..."}
"""How characters are written where the terminal's encoding has none for them."""
_failures: dict[int, str] = {}
"""Why a stream could not be written to, by its file number."""
_results: TextIO | None = None
"""Where results for programs go while `keep_for_results` holds standard output."""


def say(text: object = "", err: bool = False) -> None:
    """Prints a line on standard output, or on standard error. Control characters are written out."""
    stream = sys.stderr if err else sys.stdout
    stream.write(clean_message(text, MOST_SHOWN if err else sys.maxsize) + "\n")
    stream.flush()


def say_result(text: str) -> None:
    """Prints a line for programs unchanged, such as JSON."""
    stream = _results or sys.stdout
    stream.write(text + "\n")
    stream.flush()


@contextmanager
def keep_for_results(wanted: bool = True, for_good: bool = False) -> Iterator[None]:
    """Keeps standard output for `say_result` while the block runs. What else is written there, also by native libraries
    and child processes, goes to standard error; with ``for_good`` also what is written after the block."""
    global _results
    if not wanted or _results is not None:
        yield
        return
    before = sys.stdout
    before.flush()
    is_own = _number(before) == 1 and _number(sys.stderr) == 2
    kept = os.dup(1) if is_own else -1
    _results = _open(kept, before) if is_own else before
    if is_own:
        os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _flush_native()
        if not for_good:
            if is_own:
                os.dup2(kept, 1)
                os.close(kept)
            _results = None


def prepare() -> None:
    """Makes the streams of this process safe: closed ones are opened, failed writes are noted and end nothing, and what
    the encoding has no character for is written in others. For a process that runs the command line alone."""
    codecs.register_error("damageest", _replace)
    for number, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:  # else the next file that is opened would get this number, and what libraries print
            os.set_inheritable(os.open(os.devnull, mode), True)  # it takes the lowest number; 1 is no use to writers
    sys.stdout = _open(1, sys.stdout)
    sys.stderr = _open(2, sys.stderr)


def describe_failure() -> str:
    """Why standard output could not be written to; empty where it could."""
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.flush()
    reasons = [reason for number, reason in _failures.items() if number != 2]
    return reasons[0] if reasons else ""


class _Raw(io.FileIO):
    """A file whose failed writes are noted and count as done, except that nobody reads the pipe any more."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            if self.fileno() != 2:
                raise
        except OSError as error:
            _failures.setdefault(self.fileno(), error.strerror or str(error))
        return len(memoryview(data).cast("B"))


def _open(number: int, like: TextIO | None) -> TextIO:
    """A text stream to a file number, with the encoding of another one."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        if like is not None:
            like.flush()
    raw = _Raw(number, "wb", closefd=False)
    encoding = getattr(like, "encoding", None) or "utf-8"
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding, "damageest", line_buffering=number == 2 or raw.isatty(), newline="\n"
    )


def _replace(error: UnicodeError) -> tuple[str, int]:
    """The handler of characters that an encoding has not."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(_PLAIN.get(one, ascii(one)[1:-1]) for one in text), error.end


def _number(stream: Any) -> int:
    try:
        return int(stream.fileno())
    except (OSError, ValueError, AttributeError):
        return -1


def _flush_native() -> None:
    """Writes out what C libraries hold back, while their output still goes to standard error."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).fflush(None)
