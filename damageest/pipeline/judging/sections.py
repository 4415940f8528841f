"""The step that cuts the sections that a job asks for."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import AdaptedPart, Mesh, Reason, Section
from damageest.findings import Sensor
from damageest.geometry.scan_field import ScanField
from damageest.geometry.transforms import move_points
from damageest.job.sections import SectionChoice
from damageest.pipeline.state import Reasons
from damageest.pipeline.steps import step
from damageest.sections.measure import Scanned, measure_sections
from damageest.trust.interval.loss import ScanErrors


@step(gives=("sections", "warnings"))
def cut_sections(
    asked_sections: tuple[SectionChoice, ...], field: ScanField, adapted: AdaptedPart | None, errors: ScanErrors,
    sensor: Sensor, unit: str,
) -> tuple[tuple[Section, ...], Reasons]:  # fmt: skip
    """Measures sections against the part as designed, also where it was adapted: bow and twist are what the field of
    an adapted part follows."""
    if not asked_sections:
        return (), ()
    part, aligned = field.part, field.aligned
    points, designed = aligned.points, Mesh(part.vertices, part.faces)
    if adapted is not None:
        points = move_points(points, np.asarray(np.linalg.inv(adapted.motion), np.float64))
        designed = Mesh(part.vertices - adapted.displacement, part.faces)
    scanned = Scanned(
        points, aligned.spacing, sensor.noise or aligned.noise, sensor.correlated, sensor.alike, errors.pose, unit
    )
    sections = measure_sections(asked_sections, designed, scanned, field.tolerance, part.tessellation_error)
    notes = [Reason("section", f"section {one.number}, {one.name}: {note}") for one in sections for note in one.notes]
    return sections, tuple(notes)
