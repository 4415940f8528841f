"""What in an output folder is the user's: it is never lost, whatever a run writes."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path

from damageest.errors import Fault, JobError
from damageest.io.files import read_json

_OURS = re.compile(
    r"result\.json|report\.(html|pdf)|job\.yaml|adapt\.npz|sections/(sections\.csv|section-\d+\.(csv|svg))|truth/(damage\.(stl|ply)|pose\.json)|stages/.*|((scan|nominal)_frame/)?"
    r"(path/site-\d+\.(csv|apt|ngc)|(scan|skin|unseen)\.ply|(doubtful/)?result\.3mf|(damage|undamaged|((doubtful/)?(damage|surface)|doubtful|deposit|milled|"
    r"surplus)/site-\d+)\.(stl|ply|step))"
)
"""What a run writes, by its path in the output folder. Other files are the user's and stay, unless the
old result.json lists them, as those that a plugin wrote in another format."""
FOLDERS = ("stages", "damage", "surface", "deposit", "milled", "path", "surplus", "doubtful", "truth",
           "sections",
           "scan_frame", "nominal_frame")  # fmt: skip
FILES = ("result.json", "report.html", "report.pdf", "job.yaml", "adapt.npz", "scan.ply", "skin.ply", "unseen.ply",
         "result.3mf",
         *(f"{name}.{kind}" for name in ("damage", "undamaged") for kind in ("stl", "ply", "step")))  # fmt: skip
"""What a run may write directly into the output folder."""


def refuse_names_in_use(target: Path) -> None:
    """Raises JobError where a file or a link of the user stands where a run writes a folder, or a folder where it
    writes a file."""
    for name in FOLDERS:
        if (target / name).is_symlink() or (target / name).is_file():
            _refuse(target / name, "a link" if (target / name).is_symlink() else "a file", "a folder")
    for name in FILES:
        if (target / name).is_dir() and not (target / name).is_symlink():
            _refuse(target / name, "a folder", "a file")


def _refuse(path: Path, found: str, written: str) -> None:
    message = f"{path} is {found}, but a run writes {written} of that name; rename it, or choose another folder"
    raise JobError([Fault(message, "output")], code="output")


def keep_own_files(old: Path, target: Path) -> None:
    """Moves the user's own files from the earlier output to the new one, and drops the rest of it.

    Where the new output has taken the name of one, it is kept under another name, and a warning says so.
    """
    if not old.exists():
        return
    ours = set(list_ours(old))
    for path in sorted(old.rglob("*")):
        if path in ours or (path.is_dir() and not path.is_symlink()):
            continue
        place = _find_place(target, path.relative_to(old))
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, place)
    shutil.rmtree(old)


def list_ours(folder: Path) -> Iterator[Path]:
    """The files of an earlier run in its output folder."""
    named = _read_named(folder)
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if (path.is_symlink() or not path.is_dir()) and (_OURS.fullmatch(name) or name in named):
            yield path


def replace_content(target: Path, new: Path, old: Path, marker: Path) -> None:
    """Replaces what an earlier run wrote into ``target`` by the files in ``new``, one by one: for a folder that cannot
    be renamed. ``old`` takes the earlier files; all lie on one file system. The user's own files are not moved.

    Where this is interrupted, `finish_replacing` with the same arguments undoes it or completes it: ``marker`` is a
    file that is there from when the earlier files are out of the way until all is done.
    """
    _move_files(list_ours(target), target, old)
    marker.touch()
    finish_replacing(target, new, old, marker)


def finish_replacing(target: Path, new: Path, old: Path, marker: Path) -> None:
    """After an interrupted `replace_content`: puts the earlier files back, or moves the rest of the new ones in."""
    if not marker.exists():
        if old.is_dir():
            _move_files([path for path in sorted(old.rglob("*")) if not path.is_dir()], old, target)
            shutil.rmtree(old)
        return
    _move_files([path for path in sorted(new.rglob("*")) if not path.is_dir()], new, target)
    shutil.rmtree(old, ignore_errors=True)
    marker.unlink()


def _move_files(paths: Iterator[Path] | list[Path], source: Path, target: Path) -> None:
    """Moves files of one folder into another, and drops the folders that are empty then."""
    parents = set[Path]()
    for path in list(paths):
        name = path.relative_to(source)
        place = target / name
        _clear_way(target, name)
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, place)
        parents |= set(path.parents[: len(name.parts) - 1])
    for folder in sorted(parents, key=lambda one: -len(one.parts)):
        with contextlib.suppress(OSError):
            folder.rmdir()


def _find_place(target: Path, name: Path) -> Path:
    """Where a file of the user can be put: under its name, or under another where the output has taken that."""
    taken = [target / one for one in (*reversed(name.parents), name) if one != Path()]
    blocked = next((one for one in taken[:-1] if one.is_symlink() or (one.exists() and not one.is_dir())), None)
    if blocked is None and not os.path.lexists(taken[-1]):
        return target / name
    if blocked is None:
        return _rename_free(target / name, target / name)
    return _rename_free(blocked, target / name) / name.relative_to(blocked.relative_to(target))


def _clear_way(target: Path, name: Path) -> None:
    """Gives what is the user's another name where a file of a run has to stand."""
    for one in (*reversed(name.parents), name):
        path = target / one
        is_folder = path.is_dir() and not path.is_symlink()
        if one != Path() and os.path.lexists(path) and (one == name or not is_folder):
            os.replace(path, _rename_free(path, path))


def _rename_free(path: Path, said: Path) -> Path:
    """A name beside ``path`` that nothing has; warns that ``said`` is kept there."""
    number = 1
    while os.path.lexists(free := path.with_name(f"{path.name}.own-{number}")):
        number += 1
    warnings.warn(f"{said}: a run needed the name; your own file is kept as {free.name}", stacklevel=2)
    return free


def _read_named(folder: Path) -> set[str]:
    """The files that an earlier result.json lists; empty where it is missing or cannot be read."""
    try:
        return set(read_json(folder / "result.json")["export"]["files"])
    except (OSError, ValueError, KeyError, TypeError):
        return set()
