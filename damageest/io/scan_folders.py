"""A folder as a scan: each file in it is one patch of the same frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from damageest.errors import InputError
from damageest.io.points import READERS

MOST_FILES = 1000
"""Patches of a folder at most."""
SHOWN = 8
"""Names of files that a note lists."""


def list_patches(folder: Path) -> tuple[list[Path], list[Path]]:
    """The files of a folder that can be read as a scan, sorted by name, and the others. Folders inside it, and files
    whose name begins with a dot, are left out. Raises InputError where none can be read, or more than `MOST_FILES`."""
    try:
        files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be opened: {error.strerror or error}") from None
    patches = [path for path in files if path.suffix.lower() in READERS]
    others = [path for path in files if path.suffix.lower() not in READERS]
    if not patches:
        held = f"; it has: {name_files(others)}" if others else ""
        raise InputError(
            f"{folder}: is a folder without a file that can be read as a scan{held}; a scan may have the format: "
            f"{', '.join(READERS)}"
        )
    if len(patches) > MOST_FILES:
        raise InputError(
            f"{folder}: the folder has {len(patches)} files, more than the {MOST_FILES} patches that are read; join "
            "them in the scanner's program"
        )
    return patches, others


def name_files(paths: Sequence[Path]) -> str:
    """The names of files, the first of many."""
    more = f" and {len(paths) - SHOWN} more" if len(paths) > SHOWN else ""
    return ", ".join(path.name for path in paths[:SHOWN]) + more
