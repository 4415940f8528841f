"""The values that stages give to each other.

All are frozen and their arrays are read-only: a stage gives a new value, it never edits one. Lengths are in the job's
unit, coordinates float64 (N,3), faces int64 (F,3). Frames: a `Scan` as read is in the scanner's frame; everything
after `align` is in the part's. ``T_part_scan`` takes a point from the scanner's frame to the part's.
"""

from __future__ import annotations

from damageest.artefacts.adapted import AdaptedPart, PriorUse
from damageest.artefacts.arrays import Bytes, Flags, Floats, Ints, Singles, Vector
from damageest.artefacts.displacement import (
    DisplacementField,
    evaluate_splines,
    fit_displacement,
    fit_scattered,
    measure_roughness,
)
from damageest.artefacts.enclosures import Enclosure, Enclosures, Evidence, EvidenceCause, Rims
from damageest.artefacts.fields import ArtefactError
from damageest.artefacts.meshes import Deposit, Mesh, Part, Solid, Surface, open_edges
from damageest.artefacts.paths import BeadFill, DepositPath, Unreached
from damageest.artefacts.poses import DatumFit, FreeMotion, Pose
from damageest.artefacts.reasons import Effect, Reason
from damageest.artefacts.scans import (
    ADDED,
    DAMAGE,
    INTACT,
    OUTLIER,
    Deviation,
    Samples,
    Scan,
    Sites,
    Truth,
    take_points,
)
from damageest.artefacts.sections import SECTION_KINDS, Section, SectionContour, SectionValue

__all__ = [
    "ADDED",
    "DAMAGE",
    "INTACT",
    "OUTLIER",
    "SECTION_KINDS",
    "AdaptedPart",
    "ArtefactError",
    "BeadFill",
    "Bytes",
    "DatumFit",
    "Deposit",
    "DepositPath",
    "Deviation",
    "DisplacementField",
    "Effect",
    "Enclosure",
    "Enclosures",
    "Evidence",
    "EvidenceCause",
    "Flags",
    "Floats",
    "FreeMotion",
    "Ints",
    "Mesh",
    "Part",
    "Pose",
    "PriorUse",
    "Reason",
    "Rims",
    "Samples",
    "Scan",
    "Section",
    "SectionContour",
    "SectionValue",
    "Singles",
    "Sites",
    "Solid",
    "Surface",
    "Truth",
    "Unreached",
    "Vector",
    "evaluate_splines",
    "fit_displacement",
    "fit_scattered",
    "measure_roughness",
    "open_edges",
    "take_points",
]
