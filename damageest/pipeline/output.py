"""The output folder: written in a hidden sibling, moved into place when it is whole.

A run that fails or is killed leaves the earlier output as it was, and its finished stages where the next run
finds them.
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

from damageest.errors import Fault, JobError
from damageest.job import yamlfile
from damageest.job.model import Job, to_plain
from damageest.pipeline.cache import Cache
from damageest.report.result_json import build_report
from damageest.result import Result
from damageest.stages.export import Written

_OURS = re.compile(
    r"result\.json|job\.yaml|truth/(damage\.(stl|ply)|pose\.json)|stages/.*|(scan_frame/)?(scan\.ply|result\.3mf"
    r"|(damage|undamaged|(damage|surface|deposit)/site-\d+)\.(stl|ply|step))"
)
"""What a run writes, by its path in the output folder. Whatever else stands there is the user's, and stays, unless the
old result.json names it as a file of its own, as where a plugin wrote another format."""


@dataclass(frozen=True)
class Workspace:
    """Where one run works: ``folder`` takes the files, ``cache`` the stages' outputs; ``target`` is the final place."""

    target: Path
    hidden: Path
    folder: Path
    cache: Cache

    def finish(self, stems: list[str]) -> None:
        """Moves the result into place; anything in the old output that is not damageest's own moves along."""
        self.cache.keep_only(stems)
        os.replace(self.cache.folder, self.folder / "stages")
        old = _old_path(self.target)
        if self.target.exists():
            os.replace(self.target, old)
        os.replace(self.folder, self.target)
        _hand_over(old, self.target)
        shutil.rmtree(self.hidden)


@contextmanager
def open_workspace(target: Path, use_cache: bool = True) -> Iterator[Workspace]:
    """Opens the hidden sibling of ``target``. Raises JobError where the target is someone else's, or in use."""
    hidden = target.parent / f".{target.name}.partial"
    _refuse_strangers(target)
    made = not hidden.exists()
    try:
        hidden.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise JobError([Fault(f"{target}: cannot be written: {error.strerror}", "output")]) from None
    with _lock(hidden, target):
        if _old_path(target).exists() and not target.exists():
            os.replace(_old_path(target), target)
        _hand_over(_old_path(target), target)  # left where a run was killed in the middle of finishing
        stages, folder = hidden / "stages", hidden / "result"
        shutil.rmtree(folder, ignore_errors=True)
        if not use_cache:
            shutil.rmtree(stages, ignore_errors=True)
        stages.mkdir(exist_ok=True)
        folder.mkdir()
        older = (target / "stages",) if use_cache else ()
        try:
            yield Workspace(target, hidden, folder, Cache(stages, older))
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            if made and stages.is_dir() and not any(stages.iterdir()):
                shutil.rmtree(hidden)


def write_report(result: Result, job: Job, folder: Path, target: Path, written: Written) -> None:
    """Writes result.json and job.yaml into ``folder``, their paths relative to ``target``, where they will stand."""
    content = build_report(result, written, lambda path: to_plain(Path(path), target))
    (folder / "result.json").write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
    (folder / "job.yaml").write_text(yamlfile.write(job.to_values(target)))


def _old_path(target: Path) -> Path:
    return target.parent / f".{target.name}.old"


def _hand_over(old: Path, target: Path) -> None:
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


def _refuse_strangers(target: Path) -> None:
    """A folder that damageest did not write is never replaced."""
    if target.is_file():
        raise JobError([Fault(f"{target} is a file; name a folder", "output")])
    if target.is_dir() and any(target.iterdir()) and not (target / "result.json").is_file():
        message = f"{target} holds files but no result.json, so it is not an earlier output; choose another folder"
        raise JobError([Fault(message, "output")])


@contextmanager
def _lock(hidden: Path, target: Path) -> Iterator[None]:
    """Holds the folder for one run; the lock goes with the process, however it ends."""
    try:
        import fcntl
    except ImportError:  # no such lock on this system
        yield
        return
    handle = os.open(hidden, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise JobError([Fault(f"another run is writing to {target}; wait, or choose another folder")]) from None
        yield
    finally:
        os.close(handle)
