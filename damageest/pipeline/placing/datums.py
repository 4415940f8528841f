"""What lies on the job's datums, and whether these still hold a pose after the scan was moved."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from damageest.artefacts import AdaptedPart, Flags, Floats, Ints, Part, Reason
from damageest.geometry.selectors import Selector
from damageest.geometry.transforms import move_points
from damageest.pipeline.state import Reasons
from damageest.stages.align import Align

MOVED = 0.1
"""Movement of the part's corners, in tolerances, from which it is told that datums do not hold the pose any more."""


def note_datums(adapted: AdaptedPart | None, aligner: Align | None, part: Part, tolerance: float, unit: str) -> Reasons:
    """Warns where a pose by datums was moved to follow an adapted part."""
    if adapted is None or not has_datums(aligner):
        return ()
    text = "the adaptation moved the scan"
    return describe_moved(part, adapted.motion, tolerance, unit, text, "adapt: none")


def has_datums(aligner: Align | None) -> bool:
    """Whether the job names datums."""
    return aligner is not None and bool(aligner.datums)


def choose_on_datums(aligner: Align | None, part: Part, places: Floats, face: Ints) -> Flags | None:
    """Which places (N,3) on the triangles ``face`` (N,) of the part lie on the job's datums; None without datums."""
    datum: Any = () if aligner is None else aligner.datums
    if not datum:
        return None
    groups: list[Any] = [getattr(one, "skin", one) for one in datum.values()] if isinstance(datum, dict) else [datum]
    items = [one if isinstance(one, Selector) else Selector(faces=(one,)) for group in groups for one in group]
    normals = part.face_normals[face]
    return np.asarray(np.any([one.matches(places, normals, face, part) for one in items], axis=0))


def describe_moved(part: Part, motion: Floats, tolerance: float, unit: str, why: str, instead: str) -> Reasons:
    """A warning where a ``motion`` (4,4) moved a part off its datums."""
    corners = np.array(list(product(*part.bounds.T)))
    far = float(np.linalg.norm(move_points(corners, motion) - corners, axis=1).max())
    if far <= MOVED * tolerance:
        return ()
    text = f"the datums do not hold the pose: {why}, by up to {far:.3g} {unit}"
    return [Reason("datum_moved", text, amount=far, unit=unit, remedy=f"give {instead} if the datums must hold")]
