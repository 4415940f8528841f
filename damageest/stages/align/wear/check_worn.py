"""Checks whether a pose explains a scan of a part that is worn over much of its skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.stages.align.refine.check_pose import PoseCheck, check_pose
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.plane_grid import PartSurface
from damageest.stages.align.wear.one_sided import measure_bands
from damageest.stages.align.wear.skin_patches import Patches, measure_patches

MOST_OUTSIDE = 0.04
"""Share of the skin that may lie outside by less than `LOW`, where wear explains a scan."""
LOW = 1.5
"""Distance outside, in tolerances, up to which points are skin; added metal is higher."""
MOST_ROUGH = 0.35
"""Share of the patches that may scatter by more than noise does, where the points lie on worn skin."""
ANOTHER = 0.003
"""Distance from the skin, in diagonals, within which skin that deviates is still that of this part, in however small a
tolerance: the smaller that is, the more of it wear and form take out of it. Another part lies farther off."""
FORM = 0.12
"""Standard deviation, in tolerances, that errors of form and of a given pose may give the mean of a patch."""


def measure_outside(patches: Patches, offset: Floats, band: Floats, tolerance: float) -> float:
    """Share of the skin that lies a little outside, for patches at distances ``offset`` (P,)."""
    low = (offset > band) & (offset < LOW * tolerance)
    return float(patches.weight[low].sum() / patches.weight.sum())


def measure_wear(patches: Patches, band: Floats, tolerance: float) -> float:
    """How deep nine tenths of the skin lie at most, in diagonals; 0 where some lies outside, or is rough."""
    if not len(patches.weight) or patches.is_flat.mean() < 1 - MOST_ROUGH:
        return 0.0
    if measure_outside(patches, patches.offset, band, tolerance) > MOST_OUTSIDE:
        return 0.0
    return max(-float(np.quantile(patches.offset[patches.is_flat], 0.1)), 0.0)


def check_with_wear(
    target: PartSurface, fitted: Fit, even: Floats, raw: Floats, tolerance: float, worn_depth: float
) -> PoseCheck:
    """As `check_pose`. Skin that is worn down to ``worn_depth``, with nothing outside, explains a scan as intact skin
    does."""
    check = check_pose(target, fitted, even, raw, tolerance)
    if check.is_acceptable and not check.note_doubts():
        return check
    if (wide := max(ANOTHER, worn_depth)) <= tolerance:
        return check
    worn = check_pose(target, fitted, even, raw, wide)
    is_shown = worn.is_acceptable and (worn_depth > tolerance or not worn.note_doubts())
    return replace(worn, rms=check.rms, inliers=check.inliers) if is_shown else check


def measure_given_wear(target: PartSurface, pose: Floats, points: Floats, noise: float, tolerance: float) -> float:
    """As `measure_wear`, for points (N,3) in a pose that was given."""
    patches = measure_patches(target, points, pose, noise, tolerance)
    return measure_wear(patches, measure_bands(patches, noise, FORM * tolerance), tolerance)
