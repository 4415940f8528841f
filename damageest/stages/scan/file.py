"""Reads the scan from files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Discriminator, Field, FiniteFloat, Tag, field_serializer, model_validator

from damageest.artefacts import Reason, Scan
from damageest.errors import InputError
from damageest.geometry.units import UnitOption
from damageest.io.large_scans import LargeScan, open_large_scan
from damageest.io.points import READERS
from damageest.io.scan_folders import list_patches, name_files
from damageest.io.scans import read_scan
from damageest.options import Options
from damageest.stages import JobPath
from damageest.stages.scan import ReadScan

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


MOST_WHOLE = 10_000_000
"""Points up to which a file is read whole where a crop needs all of them and the job does not say how many."""


class ViewFile(Options):
    """One file of several, with the position of its scanner."""

    model_config = ConfigDict(defer_build=True)
    path: JobPath = Field(description="the file, relative to the job's folder")
    viewpoint: Vector | None = Field(
        None,
        description="scanner position: [x, y, z] in the file's unit and frame; default: the file's own",
    )


Entry = Annotated[
    Annotated[JobPath, Tag("file alone")] | Annotated[ViewFile, Tag("file with viewpoint")],
    Discriminator(lambda value: "file with viewpoint" if isinstance(value, (dict, ViewFile)) else "file alone"),
]


class ScanFile(ReadScan):
    """Reads a scan from one file, from several views in one frame, or from a folder of them: points or meshes."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = tuple(READERS)
    path: Annotated[
        Annotated[JobPath, Tag("one file")] | Annotated[tuple[Entry, ...], Tag("several files")],
        Discriminator(lambda value: "several files" if isinstance(value, (list, tuple)) else "one file"),
    ] = Field(
        description="the file, a list of files in one frame, or a folder whose files are the patches of one scan, "
        "relative to the job's folder"
    )
    viewpoint: Vector | None = Field(
        None,
        description="scanner position for all points of a single file: [x, y, z] in the file's unit and frame; "
        "default: the file's own",
    )
    unit: UnitOption | None = Field(
        None,
        description="unit of the files' lengths; default: the file's own (E57, PTX, glTF: m; others as their header "
        "says), else the job's `units`",
    )
    columns: str | None = Field(
        None,
        description="meaning of the columns of a text file, e.g. 'x y z _ nx ny nz'; default: from the header or their "
        "number",
    )
    scale: Literal["auto"] | None = Field(
        None,
        description="auto: where the scan is larger or smaller than the part, it is scaled by the factor that fits "
        "best; default: a wrong scale is reported, not corrected",
    )

    min_confidence: FiniteFloat | None = Field(
        None,
        description="least confidence (property or column confidence or quality, on the file's scale) of used "
        "points; default: all are used",
    )
    most_points: int = Field(
        4_000_000,
        ge=0,
        description="number of points used of a larger file (PLY, NPY, LAS, LAZ, E57), about, with all points "
        "near damage; 0: all points, at any cost of memory",
    )

    @model_validator(mode="after")
    def _check_viewpoint(self) -> Self:
        if self.viewpoint is not None and not isinstance(self.path, Path):
            raise ValueError("viewpoint: is for a single file; of several, give each as {path: ..., viewpoint: ...}")
        return self

    @field_serializer("path", mode="wrap")
    def _list_path(self, value: Any, handler: Any) -> Any:
        """The path with the files of a folder in its place, which are what is read."""
        if not self._list_folders():
            return handler(value)
        try:
            return tuple(file.path if file.viewpoint is None else file.model_dump() for file in self._list_files())
        except InputError:
            return handler(value)

    def leave_out(self, folder: Path) -> Self:
        """The same. Raises InputError for a folder of patches that the run writes its own files into."""
        for path in self._list_folders():
            if folder.resolve() == path.resolve():
                raise InputError(
                    f"scan: the folder {path} is the one that this run writes to; put the patches into a folder of "
                    "their own"
                )
        return self

    @property
    def finds_scale(self) -> bool:
        return self.scale == "auto"

    def run(self, unit: str) -> Scan:
        """The points in ``unit``, the job's. Raises InputError for a file that cannot be read or has no points."""
        if large := self._open_large(unit):
            return self._note_folders(large.thin(self.most_points))
        files = self._list_files()
        paths, places = [file.path for file in files], [file.viewpoint for file in files]
        return self._note_folders(read_scan(paths, unit, self.unit, self.columns, places, self.min_confidence))

    def _note_folders(self, scan: Scan) -> Scan:
        """The scan with notes of the files of each folder that were read, and warnings of those that were not."""
        for folder in self._list_folders():
            patches, others = list_patches(folder)
            note = f"the folder {folder.name} has {len(patches)} patches: {name_files(patches)}"
            scan = replace(scan, notes=(*scan.notes, note))
            if others:
                text = (
                    f"{len(others)} files of the folder {folder.name} were not read: no format of scans: "
                    f"{name_files(others)}"
                )
                note_others = Reason(
                    "files_not_read", text, amount=len(others), remedy="convert them to PLY, or move them away"
                )
                scan = replace(scan, warnings=(*scan.warnings, note_others))
        return scan

    def read_pieces(self, unit: str) -> Iterator[Scan]:
        large = self._open_large(unit)
        return iter(()) if large is None else large.read()

    def read_otherwise(self, unit: str) -> Iterator[Scan]:
        """The scan with x, y and z in other columns of text files; nothing where the job or the files say which."""
        from damageest.io.points.text import list_other_columns

        files = self._list_files()
        paths, places = [file.path for file in files], [file.viewpoint for file in files]
        if self.columns or any(READERS.get(path.suffix.lower()) != "text" for path in paths):
            return
        for columns in list_other_columns(paths[0]):
            with suppress(InputError):  # such as of other files with fewer columns
                scan = read_scan(paths, unit, self.unit, columns, places, self.min_confidence)
                yield replace(self._note_folders(scan), columns=(columns,))

    def _open_large(self, unit: str) -> LargeScan | None:
        if not self.most_points:
            return None
        files, most = self._list_files(), self.most_points
        if "most_points" not in self.model_fields_set and any(crop.needs_all for crop in self.crop):
            most = MOST_WHOLE
        places = [file.viewpoint for file in files]
        return open_large_scan([file.path for file in files], unit, self.unit, places, most, self.min_confidence)

    def _list_files(self) -> list[ViewFile]:
        """The files, those of folders among them, with the positions of their scanners."""
        files: list[ViewFile] = []
        for entry in self._list_entries():
            if not entry.path.is_dir():
                files.append(entry)
                continue
            if entry.viewpoint is not None:
                raise InputError(
                    f"{entry.path}: viewpoint is of one view, and a folder has several; give each file as "
                    "{path: ..., viewpoint: ...}"
                )
            files += [ViewFile(path=path) for path in list_patches(entry.path)[0]]
        return files

    def _list_entries(self) -> list[ViewFile]:
        """What the job names: files and folders."""
        if isinstance(self.path, Path):
            return [ViewFile(path=self.path, viewpoint=self.viewpoint)]
        return [item if isinstance(item, ViewFile) else ViewFile(path=item) for item in self.path]

    def _list_folders(self) -> list[Path]:
        return [entry.path for entry in self._list_entries() if entry.path.is_dir()]
