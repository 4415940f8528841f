"""A folder of patches as the scan of a job."""

from __future__ import annotations

from pathlib import Path

from damageest.errors import InputError
from damageest.io.files import resolve_path
from damageest.io.scan_folders import list_patches
from damageest.job.model import find_paths
from damageest.stages import Stage


def may_be_patches(text: str, folder: Path) -> bool:
    """Whether a path, relative to the job's ``folder``, is a folder, which `file` reads, or may be meant as one that is
    not there."""
    try:
        place = resolve_path(Path(text), folder)
        return place.is_dir() or (not place.suffix and not place.exists())
    except (OSError, ValueError):  # of a name that the system cannot have: its own check says so
        return False


def describe_no_patches(folder: Path) -> str:
    """Why a folder is no scan. One with patches is read as them, so that its path stands in no job."""
    try:
        list_patches(folder)
    except InputError as error:
        return str(error).removeprefix(f"{folder}: ")
    return "is a folder, not a file"


def describe_part_among(part: Stage | None, scan: Stage | None) -> str:
    """That the part's own file is among several files of the scan, as in a folder of both; empty where it is not."""
    if part is None or scan is None:
        return ""
    own = {path for _, path in find_paths(part.model_dump())}
    views = [path for _, path in find_paths(scan.model_dump())]
    if len(views) < 2 or not (both := own & set(views)):
        return ""
    return f"{min(both)}: is the part, and among the files of the scan; put those into a folder of their own"
