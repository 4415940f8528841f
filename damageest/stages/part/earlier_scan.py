"""Takes an earlier scan of the same part in place of its design: what was lost since then is the damage."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, FiniteFloat, model_validator

from damageest.artefacts import Part, Vector
from damageest.errors import InputError
from damageest.geometry.units import UnitOption
from damageest.io.files import files_sha256
from damageest.stages import JobPath
from damageest.stages.part import ReadPart

MIN_POINTS = 1000


class EarlierScan(ReadPart):
    """Takes an earlier scan of the same part, also a partial one: for wear between two scans.

    An arbitrary surface closes its gaps: they count as unseen skin, and scan points there are ignored.
    """

    use: Literal["earlier_scan"] = "earlier_scan"
    path: JobPath | tuple[JobPath, ...] = Field(
        description="the earlier scan, a file or a list of files in one frame, relative to the job's folder"
    )
    unit: UnitOption | None = Field(
        None, description="unit of the files' lengths; default: the file's own (E57: m), else the job's `units`"
    )
    viewpoint: tuple[FiniteFloat, FiniteFloat, FiniteFloat] | None = Field(
        None,
        description="scanner position for all points of a single file: [x, y, z] in the file's unit and frame; "
        "default: the file's own",
    )
    cell: float | None = Field(
        None, gt=0, description="resolution, in the job's unit; default: from the spacing and noise of the scan"
    )
    most_cells: int = Field(
        8_000_000,
        ge=100_000,
        le=100_000_000,
        description="largest number of grid cells; a default resolution is made coarser to meet it",
    )

    @model_validator(mode="after")
    def _check_viewpoint(self) -> Self:
        if self.viewpoint is not None and not isinstance(self.path, Path):
            raise ValueError("viewpoint: is for a single file; files of several views need their positions in them")
        return self

    def run(self, unit: str) -> Part:
        """The part in ``unit``, in the frame of the earlier scan. ``tessellation_error``: how far the surface is off
        held-out points beyond their noise. Raises InputError where the scan does not tell inside from outside."""
        paths = (self.path,) if isinstance(self.path, Path) else self.path
        return read_earlier(paths, unit, self.unit, self.cell, self.most_cells, self.viewpoint)


def read_earlier(
    paths: tuple[Path, ...], unit: str, source: str | None = None, cell: float | None = None,
    most_cells: int = 8_000_000, viewpoint: Vector | None = None,
) -> Part:  # fmt: skip
    """The part that an earlier scan in files shows, in ``unit``; ``source``: the unit of the files, None: their own;
    ``viewpoint``: where the scanner of a single file stood, in its unit and frame, None: what the file says.

    Raises InputError where they cannot be read, or the scan does not tell inside from outside.
    """
    from damageest.stages.part._oriented import read_oriented
    from damageest.stages.part._scanned_surface import close_surface

    name = ", ".join(map(str, paths))
    scan = read_oriented(paths, unit, source, viewpoint)
    if len(scan.points) < MIN_POINTS:
        raise InputError(f"{name}: {len(scan.points)} points are too few for a part; at least {MIN_POINTS} are needed")
    try:
        made = close_surface(scan, cell, most_cells)
    except InputError as fault:
        raise InputError(f"{name}: {fault}") from None
    digest = files_sha256(paths)
    note = (
        f"made from an earlier scan of {len(scan.points)} points, in its frame: {made.seen_area:.4g} {unit}² of skin, "
        f"noise {made.noise:.3g}, edges rounded by about {made.cell:.3g}"
    )
    return Part(
        made.vertices, made.faces, unit, name, digest, tessellation_error=made.error,
        notes=(*scan.notes, *map(str, scan.warnings), note), unseen=made.unseen, scan_noise=made.noise,
        scan_spacing=made.spacing,
    )  # fmt: skip
