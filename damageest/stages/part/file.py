"""The part from a mesh file."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.meshio import MESH_SUFFIXES, checked_file, read_mesh, sha256
from damageest.stages import JobPath
from damageest.stages.part import ReadPart
from damageest.stages.part._make import make_part
from damageest.units import Unit, canonical, factor


class PartFile(ReadPart):
    """A part from a mesh file: STL, PLY, OBJ, OFF or 3MF. For STEP, IGES and BREP: the plugin damageest-cadquery."""

    use: Literal["file"] = "file"
    reads: ClassVar[tuple[str, ...]] = MESH_SUFFIXES
    path: JobPath = Field(description="the file, relative to the job's folder")
    unit: Unit | None = Field(
        None, description="unit of the file's lengths; default: the file's own (3MF), else the job's `units`"
    )
    repair: bool = Field(
        True, description="mend small faults (duplicate vertices, windings, holes of a few edges, overlapping bodies)"
    )

    def run(self, unit: str) -> Part:
        """The part in ``unit``, the job's. Raises InputError for a file that is not a solid and cannot be made one."""
        checked_file(self.path, self.reads, "a part")
        vertices, faces, own = read_mesh(self.path)
        notes: tuple[str, ...] = ()
        try:
            source = self.unit or (canonical(own) if own else unit)
        except InputError as error:
            raise InputError(f"{self.path}: {error}; set part.unit") from None
        if canonical(source) != canonical(unit):
            vertices = vertices * factor(source, unit)
            notes = (f"converted from {canonical(source)} to {canonical(unit)}",)
        return make_part(
            vertices, faces, unit, path=str(self.path), sha256=sha256(self.path), repair=self.repair, notes=notes
        )
