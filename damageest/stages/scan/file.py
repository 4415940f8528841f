"""The scan from files."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Scan
from damageest.errors import InputError
from damageest.stages import JobPath
from damageest.stages.scan import ReadScan
from damageest.stages.scan._formats import READERS, Cloud, read_cloud
from damageest.stages.scan._make import make_scan
from damageest.units import Unit, canonical, factor


class ScanFile(ReadScan):
    """A scan from one file, or from several views that already share a frame: point clouds or meshed scans."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = tuple(READERS)
    path: JobPath | tuple[JobPath, ...] = Field(description="the file or files, relative to the job's folder")
    unit: Unit | None = Field(
        None, description="unit of the files' lengths; default: the file's own (E57: m), else the job's `units`"
    )
    columns: str | None = Field(
        None, description="what the columns of a text file are, e.g. 'x y z _ nx ny nz'; default: by header or number"
    )

    def run(self, unit: str) -> Scan:
        """The points in ``unit``, the job's. Raises InputError for a file that cannot be read or holds no points."""
        paths = (self.path,) if isinstance(self.path, Path) else self.path
        if not paths:
            raise InputError("scan: no file named")
        clouds = [read_cloud(path, self.columns) for path in paths]
        notes: list[str] = []
        scaled = [self._scaled(cloud, path, unit, notes) for cloud, path in zip(clouds, paths, strict=True)]
        points = scaled[0] if len(scaled) == 1 else np.concatenate(scaled)
        given = [cloud.normals for cloud in clouds if cloud.normals is not None]
        normals = np.concatenate(given) if len(given) == len(clouds) else None
        if given and normals is None:
            notes.append("only some of the files have normals: they are not used")
        return make_scan(points, normals, unit, paths=tuple(map(str, paths)), notes=tuple(notes))

    def _scaled(self, cloud: Cloud, path: Path, unit: str, notes: list[str]) -> Floats:
        many = not isinstance(self.path, Path)
        notes.extend(f"{path.name}: {note}" if many else note for note in cloud.notes)
        source = canonical(self.unit or cloud.unit or unit)
        if source == canonical(unit):
            return np.asarray(cloud.points, dtype=np.float64)
        note = f"{path.name}: converted from {source} to {canonical(unit)}"
        notes.append(note)
        return np.asarray(cloud.points, dtype=np.float64) * factor(source, unit)
