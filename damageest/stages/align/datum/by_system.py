"""The last fit of a pose by a datum system: each datum takes what those before it leave, and the rest of the skin fixes
what all of them leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, FreeMotion, Ints, Reason
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align.datum._fit import fit_datum
from damageest.stages.align.datum._points import gather_points
from damageest.stages.align.datum._words import REMEDY, Fits, describe_system, list_motions
from damageest.stages.align.datum.system import DatumSystem
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.wear.datum_skin import DatumSkin
from damageest.stages.align.wear.finish import MIN_PATCHES, MIN_STEP, Finish, Found, finish_pose, search_pose
from damageest.stages.align.wear.free import find_freedoms
from damageest.stages.align.wear.one_sided import measure_bands, measure_movement
from damageest.stages.align.wear.skin_patches import REACH, Patches, find_basis, measure_patches
from damageest.stages.align.wear.words import name_motion, to_free_motion

SAMPLES = 5000
"""Places on the part by which its symmetries are told from motions that nothing fixes."""
ROUNDS = 4
"""Fits of all datums; after each one the points on them are found anew."""
STILL = 1e-3
"""Movement of the part, in tolerances, after which no more rounds are needed."""
RIM = 5.0
"""Distance from the rim of a datum, in tolerances, within which its points are left out: as deep as wear beside it."""
FORM = 0.12
"""Standard deviation, in tolerances, that errors of form may give the mean of a patch."""
OPEN = 0.02
"""Movement of the part's skin by a motion, as a share of that by others, from which the motion is no symmetry."""
APART = 0.5
"""Movement of the skin, in tolerances, from which poses differ."""
MIN_BETTER = 0.05
"""Share of the skin by which more lies on the part in a pose, for it to be told that the datums exclude it."""
MOST_OUTSIDE = 0.1
"""Share of the skin that may lie outside, where the datums are right; added metal covers less."""


def finish_by_datum(
    frame: Frame, points: Floats, raw: Floats, best: Fit, noise: float, tolerance: float, unit: str,
    datum: DatumSkin | DatumSystem | None,
) -> Finish:  # fmt: skip
    """As `finish_pose`, also for a datum system, which is fitted to the points ``raw`` (M,3): all that are at hand."""
    if not isinstance(datum, DatumSystem):
        finish = finish_pose(frame, points, best, noise, tolerance, unit, datum)
        return finish if datum is None else _check_list(frame, points, finish, noise, tolerance, unit)
    pose, free, fits, spread = _fit_datums(frame, raw, best.pose, noise, tolerance, datum)
    pose, found = _fit_rest(frame, points, pose, free, noise, tolerance)
    freedoms: tuple[FreeMotion, ...] = ()
    if found is not None:
        patches, explained = found
        motions = find_freedoms(patches, explained.motions, explained.band, tolerance)
        freedoms = tuple(to_free_motion(frame, patches.basis @ one.motion, one.low, one.high, unit) for one in motions)
    told = describe_system(frame, datum, fits, free, tolerance, unit)
    patches = measure_patches(frame.target, points, pose, noise, tolerance)
    band = measure_bands(patches, noise, FORM * tolerance)
    doubts = told.doubts + _check_outside(frame, patches, band, tolerance, unit)
    doubts += _check_open(frame, patches, free)
    is_held = not doubts
    if is_held:
        doubts = _note_decided(frame, patches, noise, tolerance, unit)
    depth = 0.0 if not is_held else _measure_depth(patches, band)
    notes = (*told.notes, *(one.text for one in freedoms))
    scaled = np.concatenate([spread[:3], spread[3:] * frame.size])
    return Finish(
        replace(best, pose=pose), freedoms, notes, depth, is_changed=True, is_held=is_held, doubts=doubts,
        datums=told.datums, left=list_motions(frame, free, unit), spread=scaled,
    )  # fmt: skip


def _check_list(frame: Frame, points: Floats, finish: Finish, noise: float, tolerance: float, unit: str) -> Finish:
    """The finish by a list of datums, which is asked what a system is: may a datum be worn, and what does it decide?"""
    patches = measure_patches(frame.target, points, finish.fit.pose, noise, tolerance)
    band = measure_bands(patches, noise, FORM * tolerance)
    doubts = _check_outside(frame, patches, band, tolerance, unit)
    if not doubts and not finish.doubts:
        doubts = _note_decided(frame, patches, noise, tolerance, unit)
    return replace(finish, doubts=finish.doubts + doubts)


def _fit_datums(
    frame: Frame, raw: Floats, pose: Floats, noise: float, tolerance: float, system: DatumSystem
) -> tuple[Floats, Floats, Fits, Floats]:
    """The pose (4,4) by the datums; the twists (6,F) that they leave free; each datum with its fit, the changes of its
    radii and the twists that its shape took; and the errors (6,K)."""
    rng = np.random.default_rng(0)
    radii = [np.zeros(sum(one.has_radius for one in feature.shapes)) for feature in system.features]
    errors: list[float | None] = [None] * len(system.features)
    for _ in range(ROUNDS):
        before, free, spread = pose, np.eye(6), np.empty((6, 0))
        fits: Fits = []
        near, shapes = _find_on_datums(frame, raw, pose, tolerance, system)
        for k, feature in enumerate(system.features):
            taken, left = feature.divide(free)
            at = move_points(raw[near], pose)
            on = gather_points(feature, at, shapes[k], frame.target.closest(at)[0], noise, RIM * tolerance)
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
) -> tuple[Ints, list[Ints]]:
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
) -> tuple[Floats, tuple[Patches, Found] | None]:
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


def _check_outside(frame: Frame, patches: Patches, band: Floats, tolerance: float, unit: str) -> tuple[Reason, ...]:
    """A doubt where much of the skin lies outside of the part, as after the fit to a worn datum."""
    if not len(patches.weight):
        return ()
    out = (patches.offset > np.maximum(band, tolerance / 2)) & patches.is_flat
    share = float(patches.weight[out].sum() / patches.weight.sum())
    if share < MOST_OUTSIDE:
        return ()
    amount = float(np.median(patches.offset[out])) * frame.size
    text = (
        f"in the pose of the datums, {share:.0%} of the skin lies {amount:.3g} {unit} outside the part: a datum is worn"
    )
    return (Reason("datum_worn", text, "contradicts", amount, unit, remedy=REMEDY),)


def _note_decided(frame: Frame, patches: Patches, noise: float, tolerance: float, unit: str) -> tuple[Reason, ...]:
    """What is to be known where the scan fits as well, or better, in poses that the datums exclude: a datum that is
    worn all over looks as an opposite face that is worn."""
    if len(patches.weight) < MIN_PATCHES or not patches.basis.shape[1]:
        return ()
    found = search_pose(patches, noise, tolerance, np.random.default_rng(0))
    motions = find_freedoms(patches, found.motions, found.band, tolerance)
    decided = [to_free_motion(frame, patches.basis @ one.motion, one.low, one.high, unit) for one in motions]
    better = found.motions[0]
    moved = float(measure_movement(patches, better[None])[0])
    if not decided and (found.gain < MIN_BETTER or not found.explains or moved < APART * tolerance):
        return ()
    if not decided:
        decided = [to_free_motion(frame, patches.basis @ better / moved, 0.0, moved, unit)]
    named = "; ".join(f"{name_motion(one)} from {one.low:.3g} to {one.high:+.3g} {unit}" for one in decided)
    text = f"the datums decide between equally good poses: {named}; if a datum is worn, other metal is lost"
    amount = max(max(-one.low, one.high) for one in decided)
    return (Reason("datum_decides", text, "note", amount, unit, remedy="check these datums for wear"),)


def _check_open(frame: Frame, patches: Patches, free: Floats) -> tuple[Reason, ...]:
    """A doubt where neither the datums nor the skin that was scanned fix the pose: motions among those that the datums
    leave ``free`` (6,F), which move the part's skin but none that was seen."""
    if not free.shape[1]:
        return ()
    points, face = sample_by_area(frame.target.known, SAMPLES, np.random.default_rng(0))
    normals = frame.target.normals[face]
    rows = np.concatenate([np.cross(points, normals), normals], axis=1)
    seen = _restrict(patches, free).basis
    unseen = free if not seen.shape[1] else free - np.linalg.qr(seen)[0] @ (np.linalg.qr(seen)[0].T @ free)
    moved = np.linalg.svd(rows @ unseen / np.sqrt(SAMPLES), compute_uv=False)
    if moved.max() < OPEN:
        return ()
    text = "neither the datums nor other skin fix the pose: the surface that would fix it is missing or unseen"
    return (Reason("pose_free", text, "contradicts", remedy="name more datums in align.datum, or scan more"),)


def _measure_depth(patches: Patches, band: Floats) -> float:
    """How deep nine tenths of the skin lie at most, in diagonals: where the datums fix the pose, worn skin beside them
    speaks against nothing."""
    inside = patches.offset < band
    return max(-float(np.quantile(patches.offset[inside], 0.1)), 0.0) if inside.any() else 0.0
