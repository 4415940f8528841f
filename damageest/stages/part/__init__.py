"""Stage `part`: its contract, and what a CAD face is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.stages import Stage, asked_by_name

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class CadFace:
    """A face of a CAD model. ``number`` and ``name`` are those of `Part.faces_brep` and `Part.face_names`.

    ``centre`` is that of its area. ``normal`` of a plane, outward; ``axis`` (a direction) of a cylinder, cone, torus or
    surface of revolution, through ``point``, which for a sphere is its centre; ``radius`` of a cylinder, sphere, or a
    torus's larger one. ``hollow``: of a cylinder or sphere, whether the metal lies outside, as round a bore.
    """

    number: int
    name: str
    kind: str
    area: float
    centre: Vector
    normal: Vector | None = None
    axis: Vector | None = None
    point: Vector | None = None
    radius: float | None = None
    hollow: bool | None = None


class ReadPart(Stage, ABC):
    """Gives the part as designed, in the job's unit.

    ``unit``: the job's unit. ``tolerance``: lambda, or None where it is still to be measured from the scan.
    ``reads`` names the file suffixes (lower case, with the dot) that an implementation with a ``path`` option
    reads: a bare path in the job picks the implementation by it. Raises InputError for a file that is not a solid
    and cannot safely be made one.
    """

    stage: ClassVar[str] = "part"
    gives: ClassVar[str] = "part"

    @asked_by_name
    @abstractmethod
    def run(self, unit: str, tolerance: float | None) -> Part: ...

    def cad_faces(self, unit: str) -> tuple[CadFace, ...]:
        """The CAD model's faces, lengths in ``unit``. Raises InputError where what is read has none."""
        raise InputError(
            f"{getattr(self, 'path', 'this part')}: a mesh has triangles, and no CAD faces to name; give the part as "
            "STEP, IGES or BREP (plugin damageest-cadquery), or choose by box or normal direction instead"
        )
