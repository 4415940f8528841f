"""What each stage gave, kept as .npz (arrays) and .json (the rest), never pickle.

An entry's key is made of the implementation, its provider's version and source, all its options, and the keys of what
it took; so an entry never becomes invalid, and a run that was stopped continues from there.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from damageest import artefacts
from damageest.errors import Fault, JobError
from damageest.io.digests import digest as digest
from damageest.io.files import file_sha256, read_json

_KINDS = {
    name: kind
    for name, kind in vars(artefacts).items()
    if isinstance(kind, type) and dataclasses.is_dataclass(kind) and not name.startswith("_")
}


def _encode(value: Any, arrays: dict[str, Any]) -> Any:
    """A value as JSON, its arrays moved to ``arrays`` and referred to by number."""
    if isinstance(value, np.ndarray):
        arrays[f"a{len(arrays)}"] = value
        return {"array": f"a{len(arrays) - 1}"}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _encode(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, "fields": fields}
    if isinstance(value, tuple):
        return {"tuple": [_encode(item, arrays) for item in value]}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"a stage gave a {type(value).__name__}, which is not an artefact")


def _decode(value: Any, arrays: Mapping[str, Any]) -> Any:
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "tuple" in value:
        return tuple(_decode(item, arrays) for item in value["tuple"])
    fields = {name: _decode(item, arrays) for name, item in value["fields"].items()}
    return _KINDS[value["kind"]](**fields)


def _seal(stem: str, arrays: Path, meta: Any) -> str:
    """The hash of an entry: of its name, so that one entry is not taken for another, of its file of arrays, and of the
    rest as JSON."""
    return hashlib.sha256(f"{stem}\n{file_sha256(arrays)}{json.dumps(meta)}".encode()).hexdigest()


def describe_unwritable(error: OSError, place: Path) -> JobError:
    """The error for a place that cannot be written, such as a full disk."""
    fault = Fault(f"{error.filename or place}: cannot be written: {error.strerror or error}", "output")
    return JobError([fault], code="output")


@dataclass(frozen=True)
class Cache:
    """Entries in ``folder``; ``older`` folders are searched too, and an entry found there is copied."""

    folder: Path
    older: tuple[Path, ...] = ()

    def get(self, name: str, key: str) -> tuple[bool, Any]:
        """(found, value). An entry whose hash is not that of its content counts as not found."""
        stem = f"{name}-{key}"
        for folder in (self.folder, *self.older):
            try:
                meta = read_json(folder / f"{stem}.json")
                if meta["sha256"] != _seal(stem, folder / f"{stem}.npz", meta["value"]):
                    continue
                with np.load(folder / f"{stem}.npz", allow_pickle=False) as stored:
                    arrays = {n: stored[n] for n in stored.files}
                value = _decode(meta["value"], arrays)
            except (OSError, EOFError, ValueError, LookupError, TypeError, zipfile.BadZipFile, zlib.error):
                continue
            if folder != self.folder:
                self._carry_over(folder, stem)
            return True, value
        return False, None

    def put(self, name: str, key: str, value: Any) -> None:
        """Writes a value. A reader never sees half an entry: the .json that makes it valid is moved in last.

        Raises JobError where the folder cannot be written.
        """
        try:
            self._put(name, key, value)
        except OSError as error:
            raise describe_unwritable(error, self.folder) from error

    def _put(self, name: str, key: str, value: Any) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, Any] = {}
        meta = _encode(value, arrays)
        stem = f"{name}-{key}"
        scratch = self.folder / f".{stem}.npz"
        with scratch.open("wb") as stream:
            np.savez(stream, **arrays)
        seal = _seal(stem, scratch, meta)
        os.replace(scratch, self.folder / f"{stem}.npz")
        scratch = self.folder / f".{stem}.json"
        scratch.write_text(json.dumps({"sha256": seal, "value": meta}), encoding="utf-8")
        os.replace(scratch, self.folder / f"{stem}.json")

    def keep_only(self, stems: Iterable[str]) -> None:
        """Drops the entries of earlier jobs, so that a folder does not grow with each change of an option."""
        wanted = {f"{stem}{suffix}" for stem in stems for suffix in (".npz", ".json")}
        if self.folder.is_dir():
            for path in self.folder.iterdir():
                if path.name not in wanted:
                    path.unlink()

    def _carry_over(self, folder: Path, stem: str) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        for suffix in (".npz", ".json"):
            target = self.folder / f"{stem}{suffix}"
            target.unlink(missing_ok=True)
            try:
                os.link(folder / f"{stem}{suffix}", target)
            except OSError:
                shutil.copyfile(folder / f"{stem}{suffix}", target)
