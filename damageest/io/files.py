"""Checks of files before they are read and before they are written, and the hash of a file."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from damageest.errors import (
    DamageestError,
    Fault,
    InputError,
    JobError,
    describe_error,
    describe_missing_library,
    is_interrupt,
)

WITHOUT_HOLES = 64 * 2**20
"""Size in bytes from which on it is checked that a file was written completely."""


def check_file(path: Path, suffixes: tuple[str, ...], what: str) -> str:
    """The file's suffix in lower case. Raises InputError if the file is missing, empty or not of ``suffixes``."""
    valid = f"{what} may have the format: {', '.join(suffixes)}"
    if wrong := describe_no_file(path):
        raise InputError(f"{path}: {wrong}; {valid}")
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


def read_json(path: Path) -> Any:
    """The content of a JSON file. Raises OSError, and ValueError for what is no JSON, or far too deep to be ours."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None


def working_folder() -> Path:
    """The working directory. Raises InputError where it was deleted."""
    try:
        return Path.cwd()
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"the working directory cannot be used: {reason}; change to another folder") from None


def file_sha256(path: Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def files_sha256(paths: Iterable[Path]) -> str:
    """One SHA-256 for several files in their order."""
    return hashlib.sha256("".join(map(file_sha256, paths)).encode()).hexdigest()


def embed_png(data: bytes) -> str:
    """A PNG as a page holds it, which then needs no other file."""
    return f"data:image/png;base64,{base64.b64encode(data).decode()}"


def shorten_error(error: BaseException) -> str:
    """The message of a library's error in one line of at most 160 characters."""
    text = describe_error(error)
    return text if len(text) <= 160 else text[:157] + "..."


def raise_environment_fault(error: BaseException) -> None:
    """Raises errors that are not the fault of the file: an interrupt, a library that does not load, and errors that
    damageest raised on purpose. A reader calls this before it reports an unreadable file."""
    if is_interrupt(error):
        raise KeyboardInterrupt from error
    if isinstance(error, DamageestError):
        raise error
    if fault := describe_missing_library(error):
        raise fault from error


def describe_no_file(path: Path) -> str:
    """Why a path names no file that can be read; empty where it does. Pipes and devices are no files: they may have no
    end."""
    try:
        if path.is_dir():
            return "is a folder, not a file"
        if path.is_file():
            return _describe_holes(path)
        if path.exists():
            return "is a pipe or a device, not a file"
        return "is a symbolic link that leads nowhere" if path.is_symlink() else "there is no such file"
    except (OSError, ValueError) as error:
        return f"cannot be opened: {getattr(error, 'strerror', None) or error}"


def _describe_holes(path: Path) -> str:
    """What is wrong with a large file of which less than half was ever written, as by a download that did not end:
    reading it would fill the memory with zeros. Empty for others."""
    size = path.stat().st_size
    if size < WITHOUT_HOLES or not hasattr(os, "SEEK_HOLE"):
        return ""
    written = at = 0
    with path.open("rb", buffering=0) as stream:
        while at < size:
            try:
                start = os.lseek(stream.fileno(), at, os.SEEK_DATA)
            except OSError:
                break  # no data after this place
            at = os.lseek(stream.fileno(), start, os.SEEK_HOLE)
            written += at - start
    if written >= size / 2:
        return ""
    return f"only {written} of its {size} bytes were ever written, as by an interrupted copy; copy the file again"


def resolve_path(path: Path, folder: Path) -> Path:
    """The absolute path of a path relative to a folder; symbolic links are resolved where that is possible."""
    return Path(os.path.realpath(folder / expand_home(path)))


def expand_home(path: Path) -> Path:
    """The path with a leading ``~`` or ``~user`` replaced by that home folder, unless there is no such user."""
    try:
        return path.expanduser()
    except RuntimeError:
        return path


def _refuse(text: str, option: str) -> JobError:
    return JobError([Fault(text)], option, code="option" if option.startswith("--") else "output")


def check_output_file(path: Path, option: str) -> None:
    """Raises JobError, which names the ``option``, where no file can be written to ``path``: before the work, not
    after it. Folders that are missing are made when it is written."""
    try:
        if path.is_dir():
            raise _refuse(f"{path} is a folder; name a file, for example {path / 'name'}{path.suffix}", option)
        if path.exists() and not path.is_file():
            raise _refuse(f"{path} is a pipe or a device; name a file", option)
        check_output_folder(path.parent, option)
        if path.exists() and not os.access(path, os.W_OK):
            raise _refuse(f"{path} cannot be written: it is read-only; name another file", option)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise _refuse(f"{str(path)[-250:]}: cannot be written: {reason}; name another file", option) from None


def check_output_folder(folder: Path, option: str) -> None:
    """The same for a folder, which is made with its parents where it is missing."""
    there = next((one for one in (folder, *folder.parents) if os.path.lexists(one)), folder)
    if not os.path.isdir(there):  # which raises nothing, whatever the rights
        what = "a file" if os.path.exists(there) else "a symbolic link that leads nowhere"
        raise _refuse(f"{there} is {what}, not a folder; name another folder", option)
    if not os.access(there, os.W_OK | os.X_OK):
        raise _refuse(f"the folder {there} cannot be written; name another, or change its rights", option)


@contextmanager
def moved_into_place(path: Path, option: str) -> Iterator[Path]:
    """Gives another name beside ``path``; the file that is written there takes its place when the block is done. One
    that was there stays where the block fails. Raises JobError where it cannot be written, for example on a full
    disk."""
    path = Path(os.path.realpath(path))  # a link stays one
    scratch = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield scratch
        os.replace(scratch, path)
    except OSError as error:
        reason = error.strerror or error
        raise _refuse(f"{path}: cannot be written: {reason}; name another file", option) from error
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)
