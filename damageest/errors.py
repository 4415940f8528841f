"""What can go wrong, sorted by who can correct it.

Every error says what is at fault, what would be valid and what to do, and carries the exit status of the command
line: 2 where the job or an input is at fault, 1 where the job is right but a stage failed or refused.
"""

from __future__ import annotations

import difflib
import errno
import os
import re
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MOST_TEXT = 2000
"""Characters of a message from a plugin or a library that are shown; the rest is cut."""
EXTRAS = {
    "pyvista": "vtk",
    "vtkmodules": "vtk",
    "pye57": "e57",
    "k3d": "report",
    "PIL": "report",
    "reportlab": "pdf",
    "distributed": "batch",
    "dask": "batch",
}
"""Python module to the extra of this package that brings it."""
_UNSHOWN = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""What a terminal or a page does not show but obeys, and what no file can hold: control characters other than the end
of a line, marks that turn the direction of writing, and halves of surrogate pairs."""


_EXPONENT = re.compile(r"(?<![\w./\\])\d(?:\.\d+)?e\+0\d(?=[\s,;:)]|$)")
"""A number from 10⁴ to 10⁹ with an exponent, which a reader would have to count out; not in the name of a file."""


def clean_message(text: object, most: int = MOST_TEXT) -> str:
    """A text that is not damageest's own, fit to be shown: of at most ``most`` characters and a note that it was cut;
    a tab is a space, other control characters are written out, as ``\\x1b``, and 1.2e+04 is 12000. Line ends stay.

    A value without text, for example an exception whose ``__str__`` raises, is named by its type.
    """
    try:
        whole = str(text)
    except Exception:
        whole = f"(a {type(text).__name__} without text)"
    kept = whole[:most].replace("\r\n", "\n").replace("\t", " ")
    kept = _EXPONENT.sub(
        lambda found: f"{float(found[0]):.0f}", _UNSHOWN.sub(lambda found: ascii(found[0])[1:-1], kept)
    )
    return kept if len(whole) <= most else f"{kept} ... (cut: {len(whole):,} characters)"


class DamageestError(Exception):
    """Base of all errors that damageest raises on purpose; its text is meant for the user. ``topic``: the word by which
    `damageest explain` says more about it; empty where it does not. ``code``: the sort of error, as in
    `damageest.error_codes`, which names the page of the documentation for it."""

    exit_status = 1
    topic = ""
    code = "unexpected"
    so_far: Any = None
    """What a run had computed before this ended it, a `damageest.result.SoFar`; None where it did not come from one."""


@dataclass(frozen=True)
class Fault:
    """One thing wrong in a job; ``line`` and ``column`` count from 1, 0 where there is no file. ``source``: what it
    stands in, where that is not the job file, such as an option of the command line."""

    message: str
    where: str = ""
    line: int = 0
    column: int = 0
    source: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


class JobError(DamageestError):
    """The job is at fault. ``faults`` names every fault found, not only the first."""

    exit_status = 2

    def __init__(self, faults: list[Fault], source: str = "job", code: str = "") -> None:
        self.faults = faults
        self.source = source
        is_option = source.startswith("--") or all(fault.source.startswith("--") for fault in faults)
        self.code = code or ("option" if is_option else "job")
        super().__init__("\n".join(self.lines()))

    def lines(self) -> list[str]:
        """One line per fault, as ``file:line:column: what``."""
        place = [f.source or (f"{self.source}:{f.line}:{f.column}" if f.line else self.source) for f in self.faults]
        return [f"{where}: {fault}" for where, fault in zip(place, self.faults, strict=True)]


class InputError(DamageestError):
    """An input file or array is at fault: unreadable, empty, not a solid, in another unit."""

    exit_status = 2

    def __init__(self, message: object = "", topic: str = "", code: str = "input") -> None:
        self.topic, self.code = topic, code
        super().__init__(message)


class CancelledError(DamageestError):
    """The caller of `damageest.run` cancelled it."""

    code = "cancelled"

    def __init__(self, message: str = "the run was cancelled") -> None:
        super().__init__(message)


class PluginError(DamageestError):
    """A stage implementation does not keep its contract, two packages provide the same name, or a plugin needs
    something that is not installed: ``remedy`` then says what to do."""

    exit_status = 2
    code = "plugin"

    def __init__(self, message: str, remedy: str = "") -> None:
        self.remedy = remedy
        super().__init__(message)


class StageError(DamageestError):
    """A stage failed, or refused an input that is valid.

    Raise it with the fault and, as ``remedy``, what the user may try; ``method``: another method of the job that may do
    it, which is added to the remedy; ``topic``: of `damageest explain`. The engine adds stage and site; for points that
    are no site yet, a description of their ``place``. ``extra``: of this package, where what is missing comes with it.
    """

    exit_status = 1

    def __init__(self, message: str, remedy: str = "", method: str = "", topic: str = "", code: str = "stage") -> None:
        self.message, self.own_remedy, self.method = message, remedy, method
        self.remedy = ", or ".join(part for part in (remedy, f"method: {method}" if method else "") if part)
        self.stage, self.use, self.site, self.place, self.topic = "", "", 0, "", topic
        self.extra, self.code = "", code
        super().__init__(message)

    def __str__(self) -> str:
        place = f"{self.stage}: {self.use}" if self.stage else ""
        where = self.place or (f"site {self.site}" if self.site else "")
        place += f" ({where})" if where else ""
        text = f"{place}: {self.message}" if place else self.message
        return f"{text}\n  try: {self.remedy}" if self.remedy else text


def describe_error(error: BaseException, most: int | None = None) -> str:
    """The message of an error in one line, cut to ``most`` characters; the name of its type where it has no message."""
    return " ".join(str(error).split())[:most] or type(error).__name__


def suggest(name: str, valid: Sequence[str]) -> str:
    """A clause that names the valid word nearest to a wrong one: `` (did you mean 'x'?)``; empty where none is near."""
    close = difflib.get_close_matches(name, valid, n=1, cutoff=0.6)
    return f" (did you mean '{close[0]}'?)" if close else ""


def describe_install(name: str, root: Path | None = None) -> str:
    """The command that adds a package of this project, for example ``damageest-paths``, or an extra, for example
    ``pdf``, to what is installed: uv's where damageest runs in the environment of a clone, else pip's. ``root``: of the
    clone, by default the folder above the package."""
    root = root or Path(__file__).resolve().parents[1]
    is_package = name.startswith("damageest-")
    if not (root / "plugins").is_dir():
        return f"pip install {name}" if is_package else f'pip install "damageest[{name}]"'
    if not _is_environment_of(root):
        return f'pip install -e "{root / "plugins" / name[10:] if is_package else f"{root}[{name}]"}"'
    at = "" if Path.cwd() == root else f" --project {root}"
    return f"{_find_uv(root)} sync --inexact --no-dev{at} {'--package' if is_package else '--extra'} {name}"


def describe_pip_install(name: str, root: Path | None = None) -> str:
    """The same for a package of others: an environment that uv made has no pip."""
    root = root or Path(__file__).resolve().parents[1]
    is_ours = (root / "plugins").is_dir() and _is_environment_of(root)
    return f"{_find_uv(root)} pip install {name}" if is_ours else f"pip install {name}"


def _is_environment_of(root: Path) -> bool:
    named = os.environ.get("UV_PROJECT_ENVIRONMENT", ".venv")
    return Path(sys.prefix).resolve() == (root / named).resolve()


def _find_uv(root: Path) -> str:
    """uv as it can be typed here: the README puts it into the clone, and not on the path."""
    own = root / ".uv/bin/uv"
    if shutil.which("uv") or not own.is_file():
        return "uv"
    return ".uv/bin/uv" if Path.cwd() == root else str(own)


def is_interrupt(error: BaseException) -> bool:
    """Whether an error comes from an interrupt (Ctrl-C). A compiled module that is interrupted while it is imported
    raises ImportError with the interrupt as its cause."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__
    return cause is not None


def find_missing_library(error: BaseException) -> str:
    """The shared library that an error names as missing, for example ``libGL.so.1``; empty for another error."""
    # ctypes raises OSError without a number
    if isinstance(error, ImportError) or (type(error) is OSError and error.errno is None):
        found = re.match(r"(\S+\.so\S*): cannot open shared object file", str(error))
        return found[1] if found else ""
    return ""


MORE_MEMORY = "a larger tolerance, fewer scan points (scan.most_points), or a larger --memory"


def describe_shortage(error: BaseException) -> StageError | None:
    """A message for the user where memory or threads ran out; None for another error."""
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return StageError("ran out of memory", MORE_MEMORY, code="memory")
    if isinstance(error, SystemError) and "without" in str(error) and "exception" in str(error):
        # Python's words for native code that fails and sets no exception
        return StageError(
            "a library failed without a reason, as it may when memory runs out", MORE_MEMORY, code="memory"
        )
    if isinstance(error, RuntimeError) and "can't start new thread" in str(error):
        return StageError(
            "no thread can be started: memory, or the number of processes, is at its limit",
            "a larger --memory, or a higher limit of processes (ulimit -u)",
            code="memory",
        )
    return None


def describe_missing_library(error: BaseException) -> StageError | None:
    """A message for the user where a Python module or a shared library does not load; None for another error."""
    if library := find_missing_library(error):
        return StageError(
            f"the system library {library} is missing",
            f"install the package that has {library}; `damageest plugins` names those that the plugins need",
            code="missing",
        )
    if isinstance(error, ModuleNotFoundError) and error.name:
        module = error.name.partition(".")[0]
        if module not in EXTRAS:
            return StageError(
                f"the Python module {error.name} is not installed", describe_pip_install(module), code="missing"
            )
        extra = EXTRAS[module]
        missing = StageError(
            f"the Python module {error.name} is not installed; the extra '{extra}' brings it",
            describe_install(extra),
            code="missing",
        )
        missing.extra = extra
        return missing
    if isinstance(error, ImportError):
        text = describe_error(error, 400)
        if "failed to map segment" in text or "cannot allocate memory" in text.lower():
            return StageError(
                f"ran out of memory, for {text.partition(':')[0]}", "more memory (--memory)", code="memory"
            )
        return StageError(
            f"a Python module cannot be loaded: {text}", "--debug shows which; install it again", code="missing"
        )
    return None
