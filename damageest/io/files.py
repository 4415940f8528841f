"""Checks that every reader makes before it reads a file, and the hash of a file."""

from __future__ import annotations

import hashlib
from pathlib import Path

from damageest.errors import DamageestError, InputError, describe_missing_library, is_interrupt


def check_file(path: Path, suffixes: tuple[str, ...], what: str) -> str:
    """The file's suffix in lower case. Raises InputError if the file is missing, empty or not of ``suffixes``."""
    valid = f"{what} may have the format: {', '.join(suffixes)}"
    if path.is_dir():
        raise InputError(f"{path}: is a folder, not a file; {valid}")
    if not path.is_file():
        raise InputError(f"{path}: no such file; {valid}")
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise InputError(f"{path}: the format '{suffix}' cannot be read; {valid}")
    try:
        with path.open("rb") as stream:
            start = stream.read(64)
    except OSError as error:
        raise InputError(f"{path}: the file cannot be opened: {error.strerror or error}") from None
    if not start:
        raise InputError(f"{path}: the file is empty; {valid}")
    if start.lstrip().lower().startswith((b"<!doctype html", b"<html")):
        raise InputError(f"{path}: the file is a web page, not {what}; {valid}\n  try: download the file again")
    return suffix


def file_sha256(path: Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def shorten_error(error: BaseException) -> str:
    """The message of a library's error in one line of at most 160 characters."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 160 else text[:157] + "..."


def raise_environment_fault(error: BaseException) -> None:
    """Raises what is not the fault of the file that is read: an interrupt, a library that does not load, and errors
    that damageest raised on purpose. A reader calls this before it says that a file is not readable."""
    if is_interrupt(error):
        raise KeyboardInterrupt from error
    if isinstance(error, DamageestError):
        raise error
    if fault := describe_missing_library(error):
        raise fault from error


def expand_home(path: Path) -> Path:
    """The path with a leading ``~`` or ``~user`` replaced by that home folder, unless there is no such user."""
    try:
        return path.expanduser()
    except RuntimeError:
        return path
