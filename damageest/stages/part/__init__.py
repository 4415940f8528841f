"""Stage `part`: its contract, and what a CAD face is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from damageest.artefacts import Part, Vector
from damageest.errors import InputError
from damageest.stages import Stage, asked_by_name


@dataclass(frozen=True)
class CadFace:
    """A face of a CAD model. Values that do not apply to its kind of surface are None.

    ``number``, ``name``: as in `Part.faces_brep` and `Part.face_names`. ``kind``: of its surface, as in
    `Part.face_kinds`. ``area`` and ``centre``: of the face. ``normal``: of a plane, outward. ``axis``: direction of the
    axis of a cylinder, cone, torus or surface of revolution. ``point``: a point on that axis; the centre of a sphere.
    ``radius``: of a cylinder or sphere; the larger one of a torus. ``hollow``: of a cylinder or sphere, whether the
    metal is on the outside, as around a bore.
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


@dataclass(frozen=True)
class CadDatum:
    """A datum of a CAD file: its letter, and the numbers of its CAD faces, as in `Part.faces_brep`."""

    name: str
    faces: tuple[int, ...]


@dataclass(frozen=True)
class CadTolerance:
    """A tolerance of a CAD file. ``kind``: for example "flatness", "surface_profile", or "diameter" of a size.
    ``value``: the width of its zone; None where it could not be read. ``faces``: numbers of CAD faces. ``datums``:
    letters of its datum system, in the order of precedence. ``limits``: of a size."""

    kind: str
    name: str
    value: float | None
    faces: tuple[int, ...] = ()
    datums: tuple[str, ...] = ()
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class CadPmi:
    """The product and manufacturing information (PMI) of a CAD file that programs can read. ``systems``: letters of
    each datum system. ``notes``: what is missing."""

    datums: tuple[CadDatum, ...] = ()
    systems: tuple[tuple[str, ...], ...] = ()
    tolerances: tuple[CadTolerance, ...] = ()
    notes: tuple[str, ...] = ()


class ReadPart(Stage, ABC):
    """Reads the part as designed.

    ``reads``: the file suffixes, in lower case with the dot, that an implementation with an option ``path`` reads. A
    bare path in the job chooses the implementation by its suffix.

    Args of ``run``:
        unit: the job's unit, one of um, mm, cm, m, in, ft.
        tolerance: the job's tolerance in that unit; None where it is yet to be measured from the scan.

    Returns:
        A watertight part in ``unit``, in its own frame, which all later stages use. A reader of CAD files gives the
        number of each triangle's CAD face in ``faces_brep``, the faces' names and kinds, and in ``tessellation_error``
        the largest distance between the CAD surface and the triangles. ``notes``: repairs and conversions.

    Raises:
        InputError: where the file cannot be read, or is not a solid and cannot safely be made one. Begin the message
            with the file's name.

    Example::

        from typing import ClassVar, Literal
        from zipfile import BadZipFile
        import numpy as np
        from pydantic import Field
        from damageest.artefacts import Part
        from damageest.errors import InputError
        from damageest.geometry.make_part import make_part
        from damageest.stages import JobPath
        from damageest.stages.part import ReadPart

        class NumpyPart(ReadPart):
            "A part from a NumPy archive with arrays vertices and faces, in the job's unit."
            use: Literal["numpy"] = "numpy"
            reads: ClassVar[tuple[str, ...]] = (".npz",)
            path: JobPath = Field(description="the file, relative to the job's folder")

            def run(self, unit: str) -> Part:
                try:
                    data = np.load(self.path)
                    vertices, faces = data["vertices"], data["faces"]
                except (OSError, EOFError, ValueError, LookupError, BadZipFile) as error:
                    raise InputError(f"{self.path}: no archive with vertices and faces ({error})") from None
                return make_part(vertices, faces, unit, path=str(self.path))  # repairs, or raises InputError
    """

    stage: ClassVar[str] = "part"
    gives: ClassVar[str] = "part"

    @asked_by_name
    @abstractmethod
    def run(self, unit: str, tolerance: float | None) -> Part: ...

    def cad_faces(self, unit: str) -> tuple[CadFace, ...]:
        """The faces of the CAD model, lengths in ``unit``. Raises InputError where the part has none."""
        raise InputError(
            f"{getattr(self, 'path', 'this part')}: a mesh has triangles but no CAD faces; give the part as STEP, "
            "IGES or BREP (plugin damageest-cadquery), or choose skin by a box or by the direction of its normal"
        )

    def cad_pmi(self, unit: str) -> CadPmi:
        """Datums and tolerances of the CAD file, lengths in ``unit``; a note where its format has none."""
        return CadPmi(notes=("a file of this format has no datums and no tolerances; STEP AP242 has",))
