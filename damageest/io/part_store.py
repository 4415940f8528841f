"""What is computed from a part alone, kept in a folder of the user for later runs with the same part.

An entry is a file of arrays. Its key is made of the part, of what was asked, and of the code that computes it, so an
entry never becomes invalid. What cannot be read or written is computed again: a run never fails by it.
"""

from __future__ import annotations

import contextlib
import functools
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.io.digests import digest

FOLDER = "DAMAGEEST_CACHE"
"""Variable of the environment that names the folder; `none`: nothing is kept."""
MOST_BYTES = 1_000_000_000
"""Size of the folder, in bytes, above which the entries that were used longest ago are removed."""
COMPUTED_BY = ("stages/align", "stages/sample", "geometry")
"""Folders of this package whose code computes what is kept."""
LIBRARIES = ("numpy", "scipy", "libigl")

Arrays = Mapping[str, NDArray[Any]]

_is_used: ContextVar[bool] = ContextVar("part_store_is_used", default=False)


@contextlib.contextmanager
def use_part_store(is_used: bool) -> Iterator[None]:
    """Whether entries are read and written inside the block; outside of any block they are not."""
    token = _is_used.set(is_used)
    try:
        yield
    finally:
        _is_used.reset(token)


def find_folder() -> Path | None:
    """The folder of the entries; None where nothing is to be kept."""
    named = os.environ.get(FOLDER, "")
    if named.lower() == "none":
        return None
    if named:
        return Path(named)
    import platformdirs

    return platformdirs.user_cache_path("damageest", appauthor=False) / "parts"


def recall(kind: str, key: str, make: Callable[[], Arrays]) -> Arrays:
    """The arrays of an entry, else those that ``make`` gives, which are kept.

    ``kind`` names the values, ``key`` is a digest of the part and of the options.
    """
    folder = find_folder() if _is_used.get() else None
    if folder is None:
        return make()
    path = folder / f"{kind}-{digest(key, describe_code())}.npz"
    found = _read(path)
    if found is not None:
        return found
    made = make()
    with contextlib.suppress(OSError):
        _write(path, made)
        _trim(folder)
    return made


@functools.cache
def describe_code() -> str:
    """A digest of the code and libraries that compute the kept values."""
    root = Path(__file__).parent.parent
    sources = [path for folder in COMPUTED_BY for path in sorted((root / folder).rglob("*.py"))]
    return digest([path.read_bytes() for path in sources], [_find_version(name) for name in LIBRARIES])


def _find_version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "unknown"


def _read(path: Path) -> Arrays | None:
    """The arrays of a file; None where there is none, or where its content is not what was written."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        seal = str(arrays.pop("seal"))
        if seal != _seal(path, arrays):
            return None
        os.utime(path)  # it was used now
    except (OSError, EOFError, ValueError, LookupError, SyntaxError, TokenError, zipfile.BadZipFile, zlib.error):
        return None
    return arrays


def _write(path: Path, arrays: Arrays) -> None:
    """Writes a file at once: a reader never sees half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scratch = path.with_name(f".{path.stem}.{os.getpid()}")
    try:
        with scratch.open("wb") as stream:
            sealed: dict[str, Any] = {"seal": np.array(_seal(path, arrays)), **arrays}
            np.savez(stream, **sealed)
        os.replace(scratch, path)
    finally:
        scratch.unlink(missing_ok=True)


def _seal(path: Path, arrays: Arrays) -> str:
    """The digest of an entry: of its name, so that one is not taken for another, and of its arrays."""
    return digest(path.name, {name: arrays[name] for name in sorted(arrays)})


def _trim(folder: Path) -> None:
    """Removes the entries that were used longest ago, until the rest is small enough."""
    files = [(path, path.stat()) for path in folder.glob("*.npz")]
    total = sum(status.st_size for _, status in files)
    for path, status in sorted(files, key=lambda file: file[1].st_mtime):
        if total <= MOST_BYTES:
            break
        path.unlink(missing_ok=True)
        total -= status.st_size
