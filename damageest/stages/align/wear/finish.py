"""The last fit of a pose: by the outermost skin, or by the skin of a datum; and what neither of them fixes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import DatumFit, Flags, Floats, FreeMotion, Reason
from damageest.errors import StageError
from damageest.geometry.transforms import make_motions
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.wear.check_worn import MOST_OUTSIDE, measure_outside, measure_wear
from damageest.stages.align.wear.datum_skin import DatumSkin
from damageest.stages.align.wear.explained import explain
from damageest.stages.align.wear.free import MIN_MOVED as APART
from damageest.stages.align.wear.free import find_freedoms
from damageest.stages.align.wear.one_sided import Proposals, measure_bands, propose_motions, search_motions
from damageest.stages.align.wear.skin_patches import Patches, measure_patches
from damageest.stages.align.wear.words import describe_open, to_free_motion

FORM_ERRORS = (0.03, 0.06, 0.12, 0.25)
"""Standard deviations, in tolerances, that errors of form and scanner give the mean of a patch."""
LARGE = (0.35, 0.5)
"""The same where nothing can be said of wear any more."""
MIN_MOVED = 0.1
"""Movement of the skin, in tolerances, below which the pose stays as the robust fit found it."""
MOST_MOVED = 0.98
"""Quantile of the patches' movements that is compared: of a turn of a shaft only the flanks of its key tell."""
MIN_STEP = 0.02
"""The same for a pose that a datum fixes."""
MIN_GAIN = 0.01
"""Share of the skin that has to come into contact for the pose to be changed."""
MIN_CONTACT = 0.1
"""Share of the skin that has to be in contact for the pose to be changed."""
MIN_PATCHES = 30
ROUNDS = 2
"""Changes of the pose; after each one the distances are measured anew."""
DATUM_WEIGHT = 1000.0
"""Weight of the datum's points against that of others."""
MIN_DATUM = 0.002
"""Share of the scan near the part that has to lie on the datum."""


@dataclass(frozen=True)
class Finish:
    """The pose after the last fit; ``is_changed``: whether it differs from the robust fit's.

    ``free``: motions that unworn skin does not exclude; ``is_held``: whether it holds the pose but for these.
    ``notes`` for the user. ``worn_depth``: how deep most of the skin lies inside, in diagonals, where nothing lies
    outside; else 0. ``doubts``, ``datums``, ``left``, ``spread``: of a datum system, as in `Pose`.
    """

    fit: Fit
    free: tuple[FreeMotion, ...] = ()
    notes: tuple[str, ...] = ()
    worn_depth: float = 0.0
    is_changed: bool = False
    is_held: bool = False
    doubts: tuple[Reason, ...] = ()
    datums: tuple[DatumFit, ...] = ()
    left: tuple[FreeMotion, ...] = ()
    spread: Floats | None = None


@dataclass(frozen=True)
class Found:
    """The best motion (K,) from the present pose, its gain of contact, and what it was chosen from."""

    patches: Patches
    band: Floats
    motions: Floats
    gain: float
    explains: bool


def finish_pose(
    frame: Frame, points: Floats, best: Fit, noise: float, tolerance: float, unit: str, datum: DatumSkin | None = None
) -> Finish:
    """Fits the pose of ``best`` once more, so that the largest area is in contact with the skin and none outside it.

    Args:
        points: (N,3) spread evenly over the scanned area. noise, tolerance: in diagonals of the part.
        unit: the job's.
        datum: the skin that fixes the pose; what it does not fix the rest fixes. None: all of the skin.

    Raises:
        StageError: where the scan does not show the datum.
    """
    target, rng, fitted = frame.target, np.random.default_rng(0), best
    for number in range(ROUNDS + 1):
        patches = measure_patches(target, points, fitted.pose, noise, tolerance)
        if len(patches.weight) < MIN_PATCHES or not patches.basis.shape[1]:
            return Finish(best)
        on_datum = None if datum is None else _find_datum(frame, datum, patches)
        found = search_pose(patches, noise, tolerance, rng, on_datum)
        motion = found.motions[0]
        moved = float(np.quantile(np.abs(motion @ patches.slopes.T), MOST_MOVED))
        wanted = found.gain > MIN_GAIN and found.explains and moved > MIN_MOVED * tolerance
        by_datum = on_datum is not None and moved > MIN_STEP * tolerance
        if number == ROUNDS or not (wanted or by_datum):
            break
        fitted = replace(fitted, pose=make_motions((patches.basis @ motion)[None])[0] @ fitted.pose)
    finish = _describe(frame, fitted, found, tolerance, unit, on_datum)
    return replace(finish, is_changed=fitted is not best)


def _find_datum(frame: Frame, datum: DatumSkin, patches: Patches) -> Flags:
    """Which patches (P,) belong to the datum. Raises StageError where there are too few of them."""
    is_datum = datum.choose(patches.place * frame.size + frame.centre, patches.face)
    share = float(patches.weight[is_datum].sum() / patches.weight.sum())
    if share < MIN_DATUM:
        raise StageError(
            f"the scan does not show the datum: {share:.1%} of its points near the part lie there, and "
            f"{MIN_DATUM:.1%} are needed",
            "name skin in align.datum that was scanned; `damageest faces` lists the CAD faces",
            topic="wear",
        )
    return is_datum


def _describe(frame: Frame, fitted: Fit, found: Found, tolerance: float, unit: str, datum: Flags | None) -> Finish:
    """What the last fit left open, in the job's unit."""
    patches = found.patches
    notes: tuple[str, ...] = ()
    if datum is not None:
        notes = describe_open(frame, patches, datum, unit)
    if not found.explains:
        return Finish(fitted, notes=notes)
    freedoms = find_freedoms(patches, found.motions, found.band, tolerance, datum)
    free = tuple(to_free_motion(frame, patches.basis @ one.motion, one.low, one.high, unit) for one in freedoms)
    depth = measure_wear(patches, found.band, tolerance)
    return Finish(fitted, free, (*notes, *(one.text for one in free)), depth, is_held=True)


def search_pose(
    patches: Patches, noise: float, tolerance: float, rng: np.random.Generator, datum: Flags | None = None
) -> Found:
    """Searches with errors of form of several sizes. Of those with which nothing lies outside, the one counts that
    explains the patches best: wear and large errors both leave skin inside, but errors leave as much outside."""
    if datum is not None:
        weighted = replace(patches, weight=np.where(datum, patches.weight, patches.weight / DATUM_WEIGHT))
        proposals = propose_motions(weighted, APART * tolerance, rng)
        return _search_with(weighted, patches, proposals, FORM_ERRORS[0], noise, tolerance)
    proposals = propose_motions(patches, APART * tolerance, rng)
    found = [_search_with(patches, patches, proposals, error, noise, tolerance) for error in FORM_ERRORS]

    def weigh(offset: Floats, error: float) -> float:
        return explain(patches, offset, error * tolerance, noise, tolerance)

    moved = [weigh(patches.move(one.motions[:1])[0], error) for one, error in zip(found, FORM_ERRORS, strict=True)]
    here = [weigh(patches.offset, error) for error in (*FORM_ERRORS, *LARGE)]
    best = max(range(len(found)), key=lambda k: (found[k].explains, moved[k]))
    if max(here) < moved[best]:
        return found[best]
    size = int(np.argmax(here))
    return replace(found[size], gain=0.0) if size < len(found) else replace(found[-1], explains=False)


def _search_with(
    weighted: Patches, patches: Patches, proposals: Proposals, error: float, noise: float, tolerance: float
) -> Found:
    """The best motion where errors of form have a standard deviation of ``error``, in tolerances. ``weighted``: the
    patches with the weights by which motions are searched."""
    band = measure_bands(patches, noise, error * tolerance)
    searched = search_motions(weighted, proposals, band)
    offset = patches.move(searched.motions[:1])[0]
    outside = measure_outside(patches, offset, band, tolerance)
    contact = float(patches.weight[np.abs(offset) < band].sum() / patches.weight.sum())
    explains = outside < MOST_OUTSIDE and contact > MIN_CONTACT
    return Found(patches, band, searched.motions, float(searched.score[0]) - searched.start, explains)
