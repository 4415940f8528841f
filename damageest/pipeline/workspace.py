"""The output folder: written in a hidden sibling, moved into place when it is whole.

No run that stops early touches the earlier output. One that is interrupted or fails puts its finished stages into
`stages/` of the output folder, where the next run finds them; a new folder then has nothing else. One that is killed
leaves them in the hidden sibling, which the next run takes over.

A folder that cannot be renamed, as a mount point, has its hidden folder within itself, and its files are replaced one
by one.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from damageest.errors import Fault, JobError
from damageest.io.files import check_output_folder
from damageest.pipeline.cache import Cache, describe_unwritable
from damageest.pipeline.own_files import finish_replacing, keep_own_files, refuse_names_in_use, replace_content

INSIDE = ".damageest"
"""Name of the hidden folder within an output folder that cannot be renamed."""


@dataclass(frozen=True)
class Workspace:
    """The folders of one run: ``folder`` for its files, ``cache`` for the stages' outputs, ``target`` the final one."""

    target: Path
    folder: Path
    cache: Cache

    def finish(self, stems: list[str]) -> None:
        """Moves the result to its final folder; the user's own files in the old output are kept."""
        self.cache.keep_only(stems)
        os.replace(self.cache.folder, self.folder / "stages")
        hidden, old = self.target / INSIDE, _old_path(self.target)
        if self.folder.parent == hidden:
            replace_content(self.target, *_inside(self.target))
            return
        if self.target.exists():
            try:
                os.replace(self.target, old)
            except OSError:  # as of a folder that was mounted since the run began
                hidden.mkdir(exist_ok=True)
                shutil.move(self.folder, hidden / "result")
                replace_content(self.target, *_inside(self.target))
                shutil.rmtree(hidden, ignore_errors=True)
                return
        os.replace(self.folder, self.target)
        keep_own_files(old, self.target)


@contextmanager
def open_workspace(target: Path, use_cache: bool = True) -> Iterator[Workspace]:
    """Opens the hidden sibling of ``target``, or a hidden folder in it where it cannot be renamed.

    Raises JobError where the target is not an output folder, holds something in the place of what a run writes, cannot
    be written to, or is in use.
    """
    try:
        _refuse_other_folder(target)
        check_output_folder(target, "output")
        hidden = _make_hidden(target)
    except OSError as error:
        raise describe_unwritable(error, target) from None
    with _lock(hidden, target):
        try:
            _finish_earlier(target, hidden)
            refuse_names_in_use(target)
            stages, folder = hidden / "stages", hidden / "result"
            shutil.rmtree(folder, ignore_errors=True)
            if not use_cache:
                shutil.rmtree(stages, ignore_errors=True)
            stages.mkdir(exist_ok=True)
            folder.mkdir()
        except (OSError, JobError) as error:
            if not any(hidden.glob("stages/*")):
                shutil.rmtree(hidden, ignore_errors=True)
            raise describe_unwritable(error, target) if isinstance(error, OSError) else error from None
        older = (target / "stages",) if use_cache else ()
        try:
            yield Workspace(target, folder, Cache(stages, older))
        except OSError as error:
            raise describe_unwritable(error, target) from error
        finally:
            if not (target / INSIDE / "moved").exists():  # else the next run moves the rest in
                _clean_up(target, hidden)


def check_target(target: Path) -> None:
    """Raises JobError where a run could not write its output to ``target``, as far as that shows before it is tried.
    Nothing is made or changed."""
    try:
        _refuse_other_folder(target)
        refuse_names_in_use(target)
        check_output_folder(target, "output")
    except OSError as error:
        raise describe_unwritable(error, target) from None


def is_in_use(target: Path) -> bool:
    """Whether a run is writing to an output folder, or was stopped there. Raises JobError for a folder that is not
    damageest's."""
    _refuse_other_folder(target)
    return (target.parent / f".{target.name}.partial").exists() or (target / INSIDE).exists()


def _clean_up(target: Path, hidden: Path) -> None:
    """Leaves the earlier output as it was, and of a run that did not finish the stages."""
    with contextlib.suppress(OSError):
        finish_replacing(target, *_inside(target))
    stages = hidden / "stages"
    shutil.rmtree(hidden / "result", ignore_errors=True)
    _keep_stages(stages, target / "stages")
    if not stages.is_dir() or not any(stages.iterdir()):
        shutil.rmtree(hidden, ignore_errors=True)  # where the system keeps an open lock file, it stays


def _inside(target: Path) -> tuple[Path, Path, Path]:
    """The new files, the earlier ones and the marker of `replace_content`, within the target."""
    hidden = target / INSIDE
    return hidden / "result", hidden / "old", hidden / "moved"


def _make_hidden(target: Path) -> Path:
    """Makes the folder in which a run works: beside the target, where it can take the target's place at once."""
    if target.is_dir() and not _can_be_renamed(target):
        hidden = target / INSIDE
        hidden.mkdir(exist_ok=True)
    else:
        hidden = target.parent / f".{target.name}.partial"
        hidden.mkdir(parents=True, exist_ok=True)
    return hidden


def _can_be_renamed(folder: Path) -> bool:
    """Whether a folder can be renamed, which a mount point cannot, nor a folder whose parent cannot be written to.

    It is asked by a rename that has to fail: onto a folder that is not empty. The system says so only where nothing
    else is in the way.
    """
    try:
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as other:
            (Path(other) / "held").touch()
            os.replace(folder, other)
    except OSError as error:
        return error.errno in (errno.ENOTEMPTY, errno.EEXIST)
    return True


def _finish_earlier(target: Path, hidden: Path) -> None:
    """Completes or undoes what a run that was killed in the middle of finishing left."""
    inside = target / INSIDE
    if inside == hidden:
        finish_replacing(target, *_inside(target))
    elif inside.is_dir():  # of a run to which this folder was a mount point, as in a container
        with _lock(inside, target):
            finish_replacing(target, *_inside(target))
            _keep_stages(inside / "stages", target / "stages")
            shutil.rmtree(inside)
    if _old_path(target).exists() and not target.exists():
        os.replace(_old_path(target), target)
    keep_own_files(_old_path(target), target)


def _keep_stages(stages: Path, kept: Path) -> None:
    """Moves the stages of a run that did not finish to the output folder. Half an entry is dropped."""
    whole = [path for path in stages.glob("*") if not path.name.startswith(".")] if stages.is_dir() else []
    if not whole:
        shutil.rmtree(stages, ignore_errors=True)
        return
    try:
        kept.mkdir(parents=True, exist_ok=True)
        for path in whole:
            os.replace(path, kept / path.name)
    except OSError:  # they stay in the hidden folder then
        return
    shutil.rmtree(stages, ignore_errors=True)


def _old_path(target: Path) -> Path:
    return target.parent / f".{target.name}.old"


def _refuse_other_folder(target: Path) -> None:
    """Raises JobError for a folder that damageest did not write: it is never replaced."""
    if target.is_file():
        raise JobError([Fault(f"{target} is a file; name a folder", "output")], code="output")
    held = {path.name for path in target.iterdir()} if target.is_dir() else set()
    held -= {"stages", INSIDE, "lost+found"}  # the last one is the system's, in a mounted volume
    if held and "result.json" not in held and not (target / INSIDE / "old/result.json").is_file():
        message = f"{target} holds files but no result.json, so it is not an earlier output; choose another folder"
        raise JobError([Fault(message, "output")], code="output")


@contextmanager
def _lock(hidden: Path, target: Path) -> Iterator[None]:
    """Keeps other runs out of the folder. The lock ends with the process, however the process ends."""
    lock = FileLock(hidden / "lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise JobError(
            [Fault(f"another run is writing to {target}; wait, or choose another folder")], code="output"
        ) from None
    except OSError as error:
        message = f"{hidden / 'lock'}: cannot be used as a lock: {error.strerror or error}; remove it"
        raise JobError([Fault(message, "output")], code="output") from None
    try:
        yield
    finally:
        lock.release()
