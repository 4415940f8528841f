"""The last fit of a pose by a datum system: each datum takes what those before it leave, and the rest of the skin fixes
what all of them leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, FreeMotion, Reason
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align._datum import DatumSkin
from damageest.stages.align._datum_fit import FittedDatum, fit_datum, gather_points
from damageest.stages.align._datum_words import REMEDY, describe_system, list_motions
from damageest.stages.align._fine import Fit
from damageest.stages.align._finish import MIN_CONTACT, MIN_STEP, Finish, finish_pose, search_pose
from damageest.stages.align._frame import Frame
from damageest.stages.align._free import find_freedoms
from damageest.stages.align._one_sided import measure_bands
from damageest.stages.align._patches import REACH, Patches, find_basis, measure_patches
from damageest.stages.align._system import DatumSystem, Feature
from damageest.stages.align._words import to_free_motion

ROUNDS = 4
"""Fits of all datums; after each one the points on them are found anew."""
STILL = 1e-3
"""Movement of the part, in tolerances, after which no more rounds are needed."""
FORM = 0.12
"""Standard deviation, in tolerances, that errors of form may give the mean of a patch."""


def finish_by_datum(
    frame: Frame, points: Floats, raw: Floats, best: Fit, noise: float, tolerance: float, unit: str,
    datum: DatumSkin | DatumSystem | None,
) -> Finish:  # fmt: skip
    """As `finish_pose`, also for a datum system, which is fitted to the points ``raw`` (M,3): all that are at hand."""
    if not isinstance(datum, DatumSystem):
        return finish_pose(frame, points, best, noise, tolerance, unit, datum)
    pose, free, fits, spread = _fit_datums(frame, raw, best.pose, noise, tolerance, datum)
    pose, found = _fit_rest(frame, points, pose, free, noise, tolerance)
    freedoms: tuple[FreeMotion, ...] = ()
    if found is not None:
        patches, explained = found
        motions = find_freedoms(patches, explained.motions, explained.band, tolerance)
        freedoms = tuple(to_free_motion(frame, patches.basis @ one.motion, one.low, one.high, unit) for one in motions)
    told = describe_system(frame, datum, fits, free, tolerance, unit)
    doubts = told.doubts + _doubt_outside(frame, points, pose, noise, tolerance, unit)
    notes = (*told.notes, *(one.text for one in freedoms))
    scaled = np.concatenate([spread[:3], spread[3:] * frame.size])
    return Finish(
        replace(best, pose=pose), freedoms, notes, is_changed=True, is_held=not doubts, doubts=doubts,
        datums=told.datums, left=list_motions(frame, free, unit), spread=scaled,
    )  # fmt: skip


def _fit_datums(
    frame: Frame, raw: Floats, pose: Floats, noise: float, tolerance: float, system: DatumSystem
) -> tuple[Floats, Floats, list[tuple[Feature, FittedDatum, Floats, Floats]], Floats]:
    """The pose (4,4) by the datums; the twists (6,F) that they leave free; each datum with its fit, the changes of its
    radii and the twists that its shape took; and the errors (6,K)."""
    rng = np.random.default_rng(0)
    radii = [np.zeros(sum(one.has_radius for one in feature.shapes)) for feature in system.features]
    errors: list[float | None] = [None] * len(system.features)
    for _ in range(ROUNDS):
        before, free, spread = pose, np.eye(6), np.empty((6, 0))
        fits: list[tuple[Feature, FittedDatum, Floats, Floats]] = []
        near, shapes = _find_on_datums(frame, raw, pose, tolerance, system)
        for k, feature in enumerate(system.features):
            taken, left = feature.divide(free)
            at = move_points(raw[near], pose)
            on = gather_points(feature, at, shapes[k], frame.target.closest(at)[0], noise)
            fitted = fit_datum(feature, on, taken, noise, tolerance, rng, errors[k])
            pose = make_motions(fitted.twist[None])[0] @ pose
            radii[k], errors[k] = fitted.radii, fitted.error
            free = (
                np.linalg.qr(np.column_stack([left, fitted.weak]))[0] if left.shape[1] + fitted.weak.shape[1] else left
            )
            spread = np.column_stack([spread - fitted.gain @ spread, fitted.spread])
            fits.append((feature, fitted, radii[k], taken))
        corners = frame.target.mesh.bounds
        moved = np.abs(move_points(corners, pose @ np.linalg.inv(before)) - corners).max()
        if moved < STILL * tolerance:
            break
    return pose, free, fits, spread


def _find_on_datums(
    frame: Frame, raw: Floats, pose: Floats, tolerance: float, system: DatumSystem
) -> tuple[Floats, list[Floats]]:
    """The points (N,) near one of the datums, and for each datum the number (N,) of the shape that each lies on."""
    distance, foot, face = frame.target.closest(move_points(raw, pose))
    near = np.abs(distance) < REACH * tolerance
    on_any = np.zeros(len(raw), bool)
    labels = []
    for feature in system.features:
        label = np.where(near, feature.label[face], -1)
        own = np.flatnonzero(label >= 0)
        outside = ~feature.skin.choose(foot[own] * frame.size + frame.centre, face[own])
        label[own[outside]] = -1
        on_any |= label >= 0
        labels.append(label)
    index = np.flatnonzero(on_any)
    return index, [label[index] for label in labels]


def _restrict(patches: Patches, free: Floats) -> Patches:
    """The patches with the motions among ``free`` (6,F) that change their distances as basis."""
    return replace(patches, basis=free @ find_basis(patches.jacobian @ free, patches.weight))


def _fit_rest(
    frame: Frame, points: Floats, pose: Floats, free: Floats, noise: float, tolerance: float
) -> tuple[Floats, tuple[Patches, object] | None]:
    """The pose with what the datums leave ``free`` (6,F) fitted to all of the skin, and what was searched last; None
    where nothing is left to fit."""
    if not free.shape[1]:
        return pose, None
    rng = np.random.default_rng(0)
    for number in range(ROUNDS):
        patches = _restrict(measure_patches(frame.target, points, pose, noise, tolerance), free)
        if not patches.basis.shape[1]:
            return pose, None
        found = search_pose(patches, noise, tolerance, rng)
        motion = found.motions[0]
        if number == ROUNDS - 1 or np.abs(motion @ patches.slopes.T).max() < MIN_STEP * tolerance:
            break
        pose = make_motions((patches.basis @ motion)[None])[0] @ pose
    return pose, (patches, found)


MOST_OUTSIDE = 0.1
"""Share of the skin that may lie outside, where the datums are right; added metal covers less."""


def _doubt_outside(
    frame: Frame, points: Floats, pose: Floats, noise: float, tolerance: float, unit: str
) -> tuple[Reason, ...]:
    """A doubt where much of the skin lies outside of the part, as after the fit to a worn datum."""
    patches = measure_patches(frame.target, points, pose, noise, tolerance)
    if not len(patches.weight):
        return ()
    band = measure_bands(patches, noise, FORM * tolerance)
    out = (patches.offset > np.maximum(band, tolerance / 2)) & patches.is_flat
    share = float(patches.weight[out].sum() / patches.weight.sum())
    contact = float(patches.weight[np.abs(patches.offset) < band].sum() / patches.weight.sum())
    if share < MOST_OUTSIDE and contact > MIN_CONTACT:
        return ()
    if share < MOST_OUTSIDE:
        text = f"in the pose that the datums give, only {contact:.0%} of the skin lies on the part"
        amount = contact
    else:
        amount = float(np.median(patches.offset[out])) * frame.size
        text = (
            f"in the pose that the datums give, {share:.0%} of the skin lies outside the part, by {amount:.3g} {unit}: "
            "no wear explains that, but a worn datum does"
        )
    return (Reason("datum_worn", text, "contradicts", amount, unit if share >= MOST_OUTSIDE else "", remedy=REMEDY),)
