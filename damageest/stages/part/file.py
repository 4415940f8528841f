"""Reads the part from a mesh file."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from damageest.artefacts import Part
from damageest.geometry.units import UnitOption
from damageest.io.parts import read_part
from damageest.io.triangles import MESH_SUFFIXES
from damageest.stages import JobPath
from damageest.stages.part import ReadPart


class PartFile(ReadPart):
    """Reads the part from a mesh: STL, PLY, OBJ, OFF or 3MF. For STEP, IGES, BREP: plugin damageest-cadquery."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = MESH_SUFFIXES
    path: JobPath = Field(description="the file, relative to the job's folder")
    unit: UnitOption | None = Field(
        None, description="unit of the file's lengths; default: the file's own (3MF), else the job's `units`"
    )
    repair: bool = Field(
        True,
        description="repair small defects (duplicate vertices, wrong windings, holes of a few edges, overlapping "
        "bodies)",
    )

    def run(self, unit: str) -> Part:
        """The part in ``unit``, the job's. Raises InputError for a file that is not a solid and cannot be repaired."""
        return read_part(self.path, unit, self.unit, self.repair)
