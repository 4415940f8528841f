"""Which jobs a batch has: files, folders, globs, and job files with a `matrix`."""

from __future__ import annotations

import glob
import itertools
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from damageest.errors import Fault, JobError
from damageest.io.files import expand_home
from damageest.job import yamlfile

MATRIX = "matrix"
"""The key of a job file whose values are tried one after the other; it is no field of a job."""
MOST_JOBS = 10_000


@dataclass(frozen=True)
class BatchJob:
    """One job of a batch. ``name`` is that of its output folder, ``settings`` what replaces values of the file
    ``path``. ``fault``: why it cannot run, found before it was read as a job."""

    name: str
    path: str
    settings: tuple[str, ...] = ()
    fault: str = ""


def find_jobs(words: Iterable[str | Path], settings: Sequence[str] = ()) -> list[BatchJob]:
    """The jobs of a batch, in the order of the words; within a folder or glob, by name. Each has a name of its own.

    ``words``: job files, folders with job files (.yaml, .yml), or globs. A file with a ``matrix`` gives a job for each
    combination of its values. Raises JobError where a folder or glob has no job file.
    """
    paths = list(dict.fromkeys(path for word in words for path in _find_files(word)))
    found = list(itertools.islice((job for path in paths for job in _read_jobs(path)), MOST_JOBS + 1))
    if len(found) > MOST_JOBS:
        raise JobError([Fault(f"more than {MOST_JOBS} jobs; divide the batch")])
    return [replace(job, settings=(*job.settings, *settings)) for job in _name_apart(found)]


def _find_files(word: str | Path) -> list[Path]:
    path = expand_home(Path(word))
    if path.is_dir():
        files = sorted(one for one in path.iterdir() if one.suffix in (".yaml", ".yml"))
        if not files:
            raise JobError([Fault("the folder has no job file (.yaml)")], str(word))
    elif not path.exists() and glob.has_magic(str(word)):
        files = sorted(Path(one) for one in glob.glob(str(path), recursive=True) if Path(one).is_file())
        if not files:
            raise JobError([Fault("no file matches")], str(word))
    else:
        files = [path]  # one that is not there is the row of that job
    return [one.absolute() for one in files]


def _read_jobs(path: Path) -> Iterator[BatchJob]:
    plain = BatchJob(_clean(path.stem), str(path))
    try:
        tree, _ = yamlfile.read(path)
        if not isinstance(tree, Mapping) or MATRIX not in tree:
            yield plain
            return
        axes = _read_matrix(tree[MATRIX], path)
    except JobError as error:
        yield replace(plain, fault=str(error))
        return
    for values in itertools.product(*axes.values()):
        labels = [_label(value, axes[key]) for key, value in zip(axes, values, strict=True)]
        name = _clean("-".join([path.stem, *labels]))
        chosen = [f"{key}={json.dumps(value)}" for key, value in zip(axes, values, strict=True)]
        yield BatchJob(name, str(path), (f"name={json.dumps(name)}", *chosen))


def _read_matrix(matrix: Any, path: Path) -> dict[str, list[Any]]:
    """The values of each key. Raises JobError for what is no matrix."""
    example = "as  matrix: {scan: [a.ply, b.ply]}  or  matrix: {scan: scans/*.ply}"
    if not isinstance(matrix, Mapping) or not matrix:
        raise JobError([Fault(f"give stage or stage.option with its values, {example}", MATRIX)], str(path))
    axes: dict[str, list[Any]] = {}
    for key, value in matrix.items():
        values = list(value) if isinstance(value, (list, tuple)) else []
        if isinstance(value, str) and glob.has_magic(value):
            base = path.parent
            values = sorted(glob.glob(str(expand_home(Path(value))), root_dir=base, recursive=True))
        if not values:
            said = "no file matches" if isinstance(value, str) else f"give a list of values, {example}"
            raise JobError([Fault(said, f"{MATRIX}.{key}")], str(path))
        axes[str(key)] = values
    return axes


def _label(value: Any, values: Sequence[Any]) -> str:
    """What tells a value of a matrix from the others, in the name of the job."""
    if isinstance(value, str):
        stems = [Path(one).stem for one in values if isinstance(one, str)]
        return Path(value).stem if stems.count(Path(value).stem) == 1 else value.replace("/", "-")
    return str(values.index(value) + 1) if isinstance(value, (list, tuple, Mapping)) else str(value)


def _clean(name: str) -> str:
    """A name as a folder can have it on any system."""
    return re.sub(r"[^\w.+-]+", "_", name).strip(".")[:120] or "job"


def _name_apart(jobs: Sequence[BatchJob]) -> list[BatchJob]:
    """The jobs with names that differ, also where the file system does not tell large letters from small ones."""
    taken: set[str] = set()
    apart = []
    for job in jobs:
        choices = itertools.chain([job.name], (f"{job.name}-{k}" for k in itertools.count(2)))
        name = next(one for one in choices if one.lower() not in taken)
        taken.add(name.lower())
        apart.append(replace(job, name=name))
    return apart
