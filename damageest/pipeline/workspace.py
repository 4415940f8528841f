"""The output folder: written in a hidden sibling, moved into place when it is whole.

No run that stops early touches the earlier output. One that is interrupted, or that fails where there is an earlier
output, puts its finished stages into `stages/` of the output folder, where the next run finds them. One that is killed
leaves them in the hidden sibling, which the next run takes over.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from damageest.errors import DamageestError, Fault, JobError
from damageest.pipeline.cache import Cache, describe_unwritable

_OURS = re.compile(
    r"result\.json|report\.html|job\.yaml|truth/(damage\.(stl|ply)|pose\.json)|stages/.*|(scan_frame/)?"
    r"(path/site-\d+\.(csv|apt|ngc)|(scan|skin|unseen)\.ply|(doubtful/)?result\.3mf|(damage|undamaged|((doubtful/)?(damage|surface)|doubtful|deposit|"
    r"surplus)/site-\d+)\.(stl|ply|step))"
)
"""What a run writes, by its path in the output folder. Other files are the user's and stay, unless the
old result.json lists them, as those that a plugin wrote in another format."""


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
        old = _old_path(self.target)
        if self.target.exists():
            os.replace(self.target, old)
        os.replace(self.folder, self.target)
        _keep_own_files(old, self.target)


@contextmanager
def open_workspace(target: Path, use_cache: bool = True) -> Iterator[Workspace]:
    """Opens the hidden sibling of ``target``. Raises JobError where the target is not an output folder, or in use."""
    hidden = target.parent / f".{target.name}.partial"
    try:
        _refuse_other_folder(target)
        hidden.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise describe_unwritable(error, target) from None
    with _lock(hidden, target):
        if _old_path(target).exists() and not target.exists():
            os.replace(_old_path(target), target)
        _keep_own_files(_old_path(target), target)  # left where a run was killed in the middle of finishing
        stages, folder = hidden / "stages", hidden / "result"
        shutil.rmtree(folder, ignore_errors=True)
        if not use_cache:
            shutil.rmtree(stages, ignore_errors=True)
        stages.mkdir(exist_ok=True)
        folder.mkdir()
        older = (target / "stages",) if use_cache else ()
        try:
            yield Workspace(target, folder, Cache(stages, older))
        except DamageestError:
            if not (target / "stages").is_dir():
                shutil.rmtree(stages, ignore_errors=True)
            raise
        except OSError as error:
            raise describe_unwritable(error, target) from error
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            _keep_stages(stages, target / "stages")
            if not stages.is_dir() or not any(stages.iterdir()):
                shutil.rmtree(hidden, ignore_errors=True)  # where the system keeps an open lock file, it stays


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


def _keep_own_files(old: Path, target: Path) -> None:
    """Moves the user's own files from the earlier output to the new one, and drops the rest of it."""
    if not old.exists():
        return
    named = _read_named(old)
    for path in sorted(old.rglob("*")):
        name = path.relative_to(old)
        ours = _OURS.fullmatch(name.as_posix()) or name.as_posix() in named
        if (path.is_dir() and not path.is_symlink()) or ours:
            continue
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, target / name)
    shutil.rmtree(old)


def _read_named(old: Path) -> set[str]:
    """The files that an earlier result.json lists; none where there is none that can be read."""
    try:
        return set(json.loads((old / "result.json").read_text())["export"]["files"])
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def _refuse_other_folder(target: Path) -> None:
    """Raises JobError for a folder that damageest did not write: it is never replaced."""
    if target.is_file():
        raise JobError([Fault(f"{target} is a file; name a folder", "output")])
    held = {path.name for path in target.iterdir()} if target.is_dir() else set()
    if held - {"stages"} and "result.json" not in held:
        message = f"{target} holds files but no result.json, so it is not an earlier output; choose another folder"
        raise JobError([Fault(message, "output")])


@contextmanager
def _lock(hidden: Path, target: Path) -> Iterator[None]:
    """Keeps other runs out of the folder. The lock ends with the process, however the process ends."""
    lock = FileLock(hidden / "lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise JobError([Fault(f"another run is writing to {target}; wait, or choose another folder")]) from None
    try:
        yield
    finally:
        lock.release()
