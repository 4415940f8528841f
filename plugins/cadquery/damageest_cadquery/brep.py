"""Reads the part from a CAD file with a boundary representation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.geometry.make_part import SMALLEST, make_part
from damageest.geometry.units import FARTHEST, UnitOption, canonical_unit, unit_factor
from damageest.io.files import check_file, file_sha256, raise_environment_fault, shorten_error
from damageest.stages import JobPath
from damageest.stages.part import CadFace, CadPmi, ReadPart

if TYPE_CHECKING:
    from damageest_cadquery.reading.read import Model

NAMED = 3
"""Faces without triangles that are named."""
LEAST_CHORD = 1e-7
"""Least chord in diagonals of the part: OpenCASCADE's own tolerance for a part of one metre is 1e-7."""


class Brep(ReadPart):
    """Reads the part from STEP, IGES or BREP; OpenCASCADE triangulates it, neighbouring faces share points."""

    isolated: ClassVar[bool] = True
    use: Literal["brep"] = "brep"
    reads: ClassVar[tuple[str, ...]] = (".step", ".stp", ".iges", ".igs", ".brep")
    path: JobPath = Field(description="the file, relative to the job's folder")
    chord: float | None = Field(
        None,
        gt=0,
        description="largest distance between CAD surface and triangles, in the job's unit; "
        "default: an eighth of the tolerance, or 5e-5 of the part's diagonal where the tolerance is auto",
    )
    angle: float = Field(
        30.0, gt=0, le=180, description="largest angle between neighbouring triangles on a curved face, in degrees"
    )
    gap: float | None = Field(
        None,
        gt=0,
        description="largest gap between surfaces of a file without a solid that is closed, in the job's unit; "
        "default: a thousandth of the part's diagonal",
    )
    unit: UnitOption | None = Field(
        None, description="unit of the file's lengths; default: the file's own, for BREP the job's `units`"
    )

    def run(self, unit: str, tolerance: float | None) -> Part:
        """The part in ``unit``. Raises InputError for a file that OpenCASCADE cannot read or that holds no solid."""
        suffix = check_file(self.path, self.reads, "a part")
        from damageest_cadquery.reading.tessellate import measure_diagonal, tessellate

        with _name_faults(self.path, suffix):
            model = self._read(suffix, unit)
            source = self.unit or model.unit or unit
            # the factor from OpenCASCADE's lengths to the job's unit
            scale = unit_factor(source, unit) / model.length
            diagonal = measure_diagonal(model.solids) * scale
            if not SMALLEST <= diagonal <= FARTHEST:
                raise InputError(f"is {diagonal:g} {unit} across; export the part again")
            chord = self.chord or (tolerance / 8 if tolerance else 5e-5 * diagonal)
            if chord < LEAST_CHORD * diagonal:
                raise InputError(
                    f"part.chord, by default an eighth of the tolerance, is {chord:g} {unit}, too small for a part "
                    f"that is {diagonal:.4g} {unit} across; give at least {LEAST_CHORD * diagonal:.2g}"
                )
            chord = min(chord, diagonal)
            mesh = tessellate(model.solids, chord / scale, self.angle, model.name_of)
        notes = list(model.notes)
        error = max(mesh.error, model.closed) * scale
        if canonical_unit(source) != canonical_unit(unit):
            notes.append(f"converted from {canonical_unit(source)} to {canonical_unit(unit)}")
        if mesh.error * scale > 1.5 * chord:
            notes.append(
                f"triangles deviate by up to {mesh.error * scale:.3g} {unit} from the CAD surface, more than the chord "
                f"of {chord:.3g}; set a smaller part.angle (now {self.angle:g}; 2 takes longer)"
            )
        try:
            return make_part(
                mesh.vertices * scale,
                mesh.faces,
                unit,
                path=str(self.path),
                sha256=file_sha256(self.path),
                faces_brep=mesh.faces_brep,
                face_names=mesh.names,
                face_kinds=mesh.kinds,
                tessellation_error=error,
                notes=tuple(notes),
                cad_scale=scale,
            )
        except InputError as fault:
            if not mesh.left_out:
                raise
            count = len(mesh.left_out)
            raise InputError(
                f"{self.path}: {count} of its faces get no triangles with any of OpenCASCADE's settings "
                f"({'; '.join(mesh.left_out[:NAMED])}); repair them in the CAD system, or set another part.chord (now "
                f"{chord:.3g} {unit}). What is left {str(fault).removeprefix(f'{self.path}: ')}"
            ) from None

    def cad_faces(self, unit: str) -> tuple[CadFace, ...]:
        """The faces of the CAD model, in the order in which `run` numbers them."""
        suffix = check_file(self.path, self.reads, "a part")
        from damageest_cadquery.reading.list_faces import list_faces

        with _name_faults(self.path, suffix):
            model = self._read(suffix, unit)
            source = self.unit or model.unit or unit
            return list_faces(model, unit_factor(source, unit) / model.length)

    def _read(self, suffix: str, unit: str) -> Model:
        """The CAD model; ``unit``: the job's."""
        from damageest_cadquery.reading.read import read

        file_unit = (self.unit or unit) if suffix == ".brep" else "mm"
        return read(self.path, suffix, None if self.gap is None else self.gap * unit_factor(unit, file_unit))

    def cad_pmi(self, unit: str) -> CadPmi:
        """Datums and tolerances of a STEP file."""
        suffix = check_file(self.path, self.reads, "a part")
        if suffix not in (".step", ".stp"):
            return super().cad_pmi(unit)
        from damageest_cadquery.reading.list_faces import number_entities
        from damageest_cadquery.reading.pmi import find_pmi
        from damageest_cadquery.reading.read import read

        with _name_faults(self.path, suffix):
            model = read(self.path, suffix)
            text = self.path.read_text(encoding="latin-1")
            return find_pmi(text, number_entities(model), unit_factor(self.unit or model.unit or unit, unit))


@contextmanager
def _name_faults(path: Path, suffix: str) -> Iterator[None]:
    """Turns the errors of reading into InputError that names the file. Interrupts and missing libraries pass."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # OpenCASCADE's exceptions share no base of their own
        raise_environment_fault(error)
        raise InputError(f"{path}: not a readable {suffix} file ({shorten_error(error)})") from None
