"""What lies in the folder of the app: parts, scans, jobs and their results. Nothing outside of it is listed or read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest.registry import Registry
from damageest_app.security import confine

MOST_FILES = 2000
DEEPEST = 4
JOBS = (".yaml", ".yml")
LEFT_OUT = ("out", "stages", "node_modules", "__pycache__")
MESHES = (".stl", ".obj", ".off", ".3mf")
"""Formats of parts without CAD faces; scans are rarely written in them."""


@dataclass(frozen=True)
class Folder:
    """The folder of the app, and which suffixes are read as part and as scan."""

    path: Path
    parts: tuple[str, ...]
    scans: tuple[str, ...]

    @classmethod
    def open(cls, path: Path, registry: Registry) -> Folder:
        """Raises InputError where there is no such folder, or it cannot be read."""
        if not path.is_dir():
            raise InputError(f"{path}: there is no such folder; name the one with part and scan, or make it first")
        if not os.access(path, os.R_OK | os.X_OK):
            raise InputError(f"{path}: the folder cannot be read; change its rights, or name another one")
        reads = {
            stage: tuple(sorted({suffix for item in registry.of(stage) for suffix in item.cls.reads}))
            for stage in ("part", "scan")
        }
        return cls(path.resolve(), reads["part"], reads["scan"])

    @property
    def is_writable(self) -> bool:
        return os.access(self.path, os.W_OK)

    def find(self, name: str) -> Path:
        """The path of a file below the folder. Raises InputError for one outside."""
        return confine(self.path, name)

    def list_files(self) -> dict[str, list[str]]:
        """The names of possible parts, scans and jobs, relative to the folder, by kind."""
        found: dict[str, list[str]] = {"parts": [], "scans": [], "jobs": []}
        for name in self._walk():
            suffix = Path(name).suffix.lower()
            if suffix in JOBS:
                found["jobs"].append(name)
            if suffix in self.parts:
                found["parts"].append(name)
            if suffix in self.scans:
                found["scans"].append(name)
        return found

    def _walk(self) -> Iterator[str]:
        count = 0
        for place, folders, files in os.walk(self.path):
            depth = len(Path(place).relative_to(self.path).parts)
            folders[:] = sorted(f for f in folders if not f.startswith(".") and f not in LEFT_OUT and depth < DEEPEST)
            for file in sorted(files):
                count += 1
                if count > MOST_FILES:
                    return
                if not file.startswith("."):
                    yield Path(place, file).relative_to(self.path).as_posix()

    def new_job(self, part: str) -> str:
        """A name for a job of this part that no file has."""
        stem = Path(part).stem
        names = [f"{stem}.yaml", *(f"{stem}-{k}.yaml" for k in range(2, 1000))]
        return next(name for name in names if not (self.path / name).exists())

    def list_jobs(self) -> list[dict[str, Any]]:
        """A row for each job file: its verdicts and volume where it has a result in `out/`."""
        return [self._describe_job(name) for name in self.list_files()["jobs"]]

    def _describe_job(self, name: str) -> dict[str, Any]:
        path = self.path / name
        row: dict[str, Any] = {"job": name, "state": "not run", "volume": "", "interval": "", "tone": ""}
        row |= dict.fromkeys(("proven", "likely", "doubtful"), 0)
        found = path.parent / "out" / path.stem / "result.json"
        try:
            content = json.loads(found.read_text(encoding="utf-8"))
            from damageest_app.running.results import format_interval

            for site in content["sites"]:
                row[site["verdict"]["level"]] += 1
            row["volume"] = f"{content['damage_volume']:.5g} {content['units']}³"
            row["interval"] = format_interval(content["volume_95"])
            doubtful = row["doubtful"] or content["failures"]
            row["state"] = "doubtful" if doubtful else "ran"
            row["tone"] = "warning" if doubtful else "success"
        except FileNotFoundError:
            pass
        except (OSError, ValueError, KeyError, TypeError):
            row["state"] = "result cannot be read"
        return row


def guess_inputs(files: dict[str, list[str]]) -> tuple[str | None, str | None]:
    """The part and the scan of a folder, where there is no choice: CAD formats are parts, then meshes, then the rest;
    a scan is rather what no part is. None where several files are as likely."""

    def rank(name: str) -> int:
        return 1 if Path(name).suffix.lower() in MESHES else 2 if name in files["scans"] else 0

    def first(names: list[str], least: bool) -> str | None:
        ranks = [rank(name) for name in names]
        best = [name for name, one in zip(names, ranks, strict=True) if one == (min(ranks) if least else max(ranks))]
        return best[0] if len(best) == 1 else None

    part = first(files["parts"], least=True)
    return part, first([name for name in files["scans"] if name != part], least=False) if part else None
