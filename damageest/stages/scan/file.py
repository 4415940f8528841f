"""Reads the scan from files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import ConfigDict, Discriminator, Field, FiniteFloat, Tag, model_validator

from damageest.artefacts import Scan
from damageest.geometry.units import UnitOption
from damageest.io.large_scans import LargeScan, open_large_scan
from damageest.io.points import READERS
from damageest.io.scans import read_scan
from damageest.options import Options
from damageest.stages import JobPath
from damageest.stages.scan import ReadScan

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class ViewFile(Options):
    """One file of several, with the position of its scanner."""

    model_config = ConfigDict(defer_build=True)
    path: JobPath = Field(description="the file, relative to the job's folder")
    viewpoint: Vector | None = Field(
        None,
        description="where the scanner stood: [x, y, z] in the file's unit and frame; default: what the file says",
    )


Entry = Annotated[
    Annotated[JobPath, Tag("file alone")] | Annotated[ViewFile, Tag("file with viewpoint")],
    Discriminator(lambda value: "file with viewpoint" if isinstance(value, (dict, ViewFile)) else "file alone"),
]


class ScanFile(ReadScan):
    """Reads a scan from one file, or from several views in one frame: point clouds or meshed scans."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = tuple(READERS)
    path: Annotated[
        Annotated[JobPath, Tag("one file")] | Annotated[tuple[Entry, ...], Tag("several files")],
        Discriminator(lambda value: "several files" if isinstance(value, (list, tuple)) else "one file"),
    ] = Field(description="the file, or a list of files in one frame, relative to the job's folder")
    viewpoint: Vector | None = Field(
        None,
        description="where the scanner stood for all points of a single file: [x, y, z] in the file's unit and frame; "
        "default: what the file says",
    )
    unit: UnitOption | None = Field(
        None, description="unit of the files' lengths; default: the file's own (E57, PTX: m), else the job's `units`"
    )
    columns: str | None = Field(
        None,
        description="meaning of the columns of a text file, e.g. 'x y z _ nx ny nz'; default: from the header or their "
        "number",
    )
    scale: Literal["auto"] | None = Field(
        None,
        description="auto: where the scan is larger or smaller than the part, it is scaled by the factor that fits "
        "best; default: a wrong scale is named and not corrected",
    )

    most_points: int = Field(
        10_000_000,
        ge=0,
        description="of a larger file (PLY, NPY, LAS, LAZ, E57) about so many points are used, chosen evenly, and all "
        "near damage in addition; 0: all points, whatever memory they need",
    )

    @model_validator(mode="after")
    def _check_viewpoint(self) -> Self:
        if self.viewpoint is not None and not isinstance(self.path, Path):
            raise ValueError("viewpoint: is for a single file; of several, give each as {path: ..., viewpoint: ...}")
        return self

    def run(self, unit: str) -> Scan:
        """The points in ``unit``, the job's. Raises InputError for a file that cannot be read or has no points."""
        if large := self._open_large(unit):
            return large.thin(self.most_points)
        files = self._list_files()
        return read_scan(
            [file.path for file in files], unit, self.unit, self.columns, [file.viewpoint for file in files]
        )

    def read_pieces(self, unit: str) -> Iterator[Scan]:
        large = self._open_large(unit)
        return iter(()) if large is None else large.read()

    def _open_large(self, unit: str) -> LargeScan | None:
        if not self.most_points:
            return None
        files = self._list_files()
        places = [file.viewpoint for file in files]
        return open_large_scan([file.path for file in files], unit, self.unit, places, self.most_points)

    def _list_files(self) -> list[ViewFile]:
        if isinstance(self.path, Path):
            return [ViewFile(path=self.path, viewpoint=self.viewpoint)]
        return [item if isinstance(item, ViewFile) else ViewFile(path=item) for item in self.path]
