"""Reads the scan from files."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from damageest.artefacts import Scan
from damageest.geometry.units import UnitOption
from damageest.io.points import READERS
from damageest.io.scans import read_scan
from damageest.stages import JobPath
from damageest.stages.scan import ReadScan


class ScanFile(ReadScan):
    """Reads a scan from one file, or from several views in one frame: point clouds or meshed scans."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = tuple(READERS)
    path: JobPath | tuple[JobPath, ...] = Field(
        description="the file, or a list of files in one frame, relative to the job's folder"
    )
    unit: UnitOption | None = Field(
        None, description="unit of the files' lengths; default: the file's own (E57: m), else the job's `units`"
    )
    columns: str | None = Field(
        None,
        description="meaning of the columns of a text file, e.g. 'x y z _ nx ny nz'; default: from the header or their "
        "number",
    )

    def run(self, unit: str) -> Scan:
        """The points in ``unit``, the job's. Raises InputError for a file that cannot be read or has no points."""
        paths = (self.path,) if isinstance(self.path, Path) else self.path
        return read_scan(paths, unit, self.unit, self.columns)
