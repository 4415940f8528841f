"""Fits one datum of a system: its own shape to the scan points on it, by the motions that it takes.

Lengths in diagonals of the part. Worn and dirty skin has no weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.stages.align.datum._points import OnDatum
from damageest.stages.align.datum.system import Feature
from damageest.stages.align.wear.explained import explain
from damageest.stages.align.wear.one_sided import measure_bands, propose_motions, search_motions

WEAK = 0.25
"""Standard deviation, in tolerances, of the movement of a datum's skin by a motion that its points do not fix."""
LOOSE = 10.0
"""Standard deviation, in tolerances, that the radius of a datum may be off."""
ERRORS = (0.03, 0.06, 0.12, 0.25)
"""Standard deviations, in tolerances, that errors of form may give the mean of a patch."""
TOLD = 0.12
"""Standard deviation, in tolerances, that a patch may be off for it to count as in contact when wear is told."""
DIRT = 0.01
"""Share of a datum that may lie above it, where a surface plate lies on the rest."""
ALIKE = 1 / 15
"""Edge, in diagonals, of the area over which a datum deviates alike, as `checks.pose_error` takes it."""
ROUNDS = 8
CONTACT = 0.3
"""Share of a datum that has to be in contact for the fit with a narrow band to be believed."""


@dataclass(frozen=True, eq=False)
class FittedDatum:
    """``twist`` (6,) moves the scan onto the datum; ``radii`` (S,): changes of its radii. ``taken`` (6,K): what it
    fixed, ``weak`` (6,W): what its shape would fix and its points do not. ``gain`` (6,6): how it answers a motion of
    the scan; ``spread`` (6,K): errors, one standard deviation each. ``contact`` and ``inside``: shares of the datum on
    the fitted shape, and below it; ``off``: how deep that is; ``rms`` of what is in contact. ``error``:
    standard deviation, in tolerances, of errors of form that explains the distances best."""

    twist: Floats
    radii: Floats
    taken: Floats
    weak: Floats
    gain: Floats
    spread: Floats
    contact: float
    inside: float
    off: float
    rms: float
    points: int
    error: float


def fit_datum(
    feature: Feature, on: OnDatum, taken: Floats, noise: float, tolerance: float, rng: np.random.Generator,
    before: float | None = None,
) -> FittedDatum:  # fmt: skip
    """Fits a datum by the twists ``taken`` (6,K) that its shape fixes. Those that its points do not fix stay out.
    ``before``: the `error` of a fit that took the scan here, so that what is in contact lies near."""
    slopes = feature.slopes @ taken / np.sqrt(len(feature.slopes))
    values, vectors = np.linalg.eigh(slopes.T @ slopes)
    even = taken @ (vectors / np.sqrt(values))  # each moves the datum's skin by 1 in the mean square
    weak = np.empty((6, 0))
    every = np.ones(len(on.patches.weight), bool)
    form = 0.0
    while True:
        even, lost = _part_weak(on, even, every, noise, form, tolerance)
        weak = np.column_stack([weak, lost])
        if not even.shape[1]:
            return _leave_out(on, weak)
        if before is None:
            moved, error = _search(on, even, noise, tolerance, rng)
        else:
            moved, error = np.zeros(even.shape[1] + on.sizes), before
        band = measure_bands(on.patches, noise, error * tolerance)
        values_now, chosen = _polish(on, even, moved, band, noise)
        if feature.is_one_sided:
            values_now = _lay_on(on, even, values_now, band, tolerance)
        offset = on.patches.offset + on.patches.jacobian @ _join(even, on.sizes) @ values_now
        form = _measure_form(offset[chosen], on.patches.weight[chosen], noise)
        if not _part_weak(on, even, chosen, noise, form, tolerance)[1].shape[1] or chosen is every:
            break
        every = chosen
    return _describe(on, even, weak, values_now, offset, chosen, noise, form, error, tolerance)


def _join(even: Floats, sizes: int) -> Floats:
    """(6+S,K+S) twists and radii as one basis."""
    basis = np.zeros((6 + sizes, even.shape[1] + sizes))
    basis[:6, : even.shape[1]] = even
    basis[6:, even.shape[1] :] = np.eye(sizes)
    return basis


def _find_variance(on: OnDatum, noise: float, form: float) -> Floats:
    """(P,) of the means of patches; errors of form are alike over an area that is larger than a patch."""
    alike = max(1.0, (ALIKE / on.edge) ** 2)
    return np.asarray(noise**2 / on.patches.weight + alike * form**2 + 1e-18)


def _find_covariance(
    on: OnDatum, even: Floats, chosen: Flags, noise: float, form: float, tolerance: float
) -> tuple[Floats, Floats]:
    """Covariance (K+S,K+S) of twists and radii, and the gain (K+S,P) of the offsets."""
    rows = on.patches.jacobian[chosen] @ _join(even, on.sizes)
    trust = 1 / _find_variance(on, noise, form)[chosen]
    prior = np.diag([1e-8 / tolerance**2] * even.shape[1] + [1 / (LOOSE * tolerance) ** 2] * on.sizes)
    covariance = np.asarray(np.linalg.inv((rows * trust[:, None]).T @ rows + prior), np.float64)
    gain = np.zeros((len(covariance), len(chosen)))
    gain[:, chosen] = covariance @ (rows * trust[:, None]).T
    return covariance, gain


def _part_weak(
    on: OnDatum, even: Floats, chosen: Flags, noise: float, form: float, tolerance: float
) -> tuple[Floats, Floats]:
    """The motions that the points ``chosen`` (P,) fix, and those that they do not."""
    count = even.shape[1]
    if not count:
        return even, even
    covariance = _find_covariance(on, even, chosen, noise, max(form, ERRORS[0] * tolerance / 5), tolerance)[0]
    values, vectors = np.linalg.eigh(covariance[:count, :count])
    is_weak = np.sqrt(np.maximum(values, 0)) > WEAK * tolerance
    if not is_weak.any():
        return even, np.empty((6, 0))
    return np.asarray(even @ vectors[:, ~is_weak]), np.asarray(even @ vectors[:, is_weak])


def _search(
    on: OnDatum, even: Floats, noise: float, tolerance: float, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Twists and radii (K+S,) by which most of the datum comes into contact and little lies outside, and the size of
    errors of form, in tolerances, that explains the distances best."""
    joined = _join(even, on.sizes)
    rows = on.patches.jacobian @ joined
    weight = on.patches.weight
    values, vectors = np.linalg.eigh((rows * weight[:, None]).T @ rows / weight.sum())
    kept = values > 1e-8 * values[-1]
    change = vectors[:, kept] / np.sqrt(values[kept])
    patches = replace(on.patches, basis=joined @ change)
    proposals = propose_motions(patches, 0.5 * tolerance, rng)
    best = -np.inf, np.zeros(len(values)), ERRORS[0]
    for error in ERRORS:
        band = measure_bands(patches, noise, error * tolerance)
        motion = search_motions(patches, proposals, band).motions[0]
        worth = explain(patches, patches.move(motion[None])[0], error * tolerance, noise, tolerance)
        if worth > best[0]:
            best = worth, change @ motion, error
    return best[1], best[2]


def _polish(on: OnDatum, even: Floats, moved: Floats, band: Floats, noise: float) -> tuple[Floats, Flags]:
    """The least-squares fit to the patches in contact, and which these are (P,). Where few are, as on a rough datum, a
    robust fit to all of them."""
    rows, weight = on.patches.jacobian @ _join(even, on.sizes), on.patches.weight
    offset = on.patches.offset + rows @ moved
    if weight[np.abs(offset) < band].sum() < CONTACT * weight.sum():
        moved = np.zeros(rows.shape[1])
        for _ in range(ROUNDS):
            offset = on.patches.offset + rows @ moved
            wide = 4.7 * 1.4826 * float(np.median(np.abs(offset))) + 1e-12
            moved = moved + _step(rows, offset, weight * np.maximum(1 - (offset / wide) ** 2, 0) ** 2)
        band = np.full(len(offset), wide)
    for _ in range(ROUNDS):
        offset = on.patches.offset + rows @ moved
        moved = moved + _step(rows, offset, weight * (np.abs(offset) < band))
    offset = on.patches.offset + rows @ moved
    return moved, np.abs(offset) < band


def _step(rows: Floats, offset: Floats, weight: Floats) -> Floats:
    weighted = (rows * weight[:, None]).T
    normal = weighted @ rows
    ridge = 1e-9 * max(float(np.trace(normal)), 1e-300)
    return np.asarray(-np.linalg.solve(normal + ridge * np.eye(len(normal)), weighted @ offset))


def _lay_on(on: OnDatum, even: Floats, moved: Floats, band: Floats, tolerance: float) -> Floats:
    """The fit from outside: no patch lies outside, and the mean gap is the smallest. Up to `DIRT` of the datum outside
    the fit that is given is dirt."""
    from scipy.optimize import linprog

    rows = on.patches.jacobian @ _join(even, on.sizes)
    offset = on.patches.offset + rows @ moved
    order = np.argsort(-offset, kind="stable")
    above = np.empty(len(offset))
    above[order] = np.cumsum(on.patches.weight[order]) / on.patches.weight.sum()
    real = (offset < band) | ((above > DIRT) & (offset < LOOSE * tolerance))
    real &= on.patches.is_flat & (offset > -LOOSE * tolerance)
    if not real.any():
        return moved
    weight = on.patches.weight[real] / on.patches.weight[real].sum()
    found = linprog(
        -(weight @ rows[real]), A_ub=rows[real], b_ub=-offset[real], bounds=(-LOOSE * tolerance, LOOSE * tolerance)
    )
    return moved if found.x is None or found.status else np.asarray(moved + found.x)


def _measure_form(offset: Floats, weight: Floats, noise: float) -> float:
    """The standard deviation of the means of patches that noise does not explain."""
    if len(offset) < 12:
        return 0.0
    excess = float(np.average(offset**2 - noise**2 / weight, weights=weight))
    chance = 2.5 * float(np.average(noise**2 / weight, weights=weight)) * np.sqrt(2 / len(offset))
    return float(np.sqrt(excess)) if excess > chance else 0.0


def _describe(
    on: OnDatum, even: Floats, weak: Floats, moved: Floats, offset: Floats, chosen: Flags, noise: float, form: float,
    error: float, tolerance: float,
) -> FittedDatum:  # fmt: skip
    count, weight = even.shape[1], on.patches.weight
    covariance, gain = _find_covariance(on, even, chosen, noise, form, tolerance)
    values, vectors = np.linalg.eigh(covariance[:count, :count])
    # errors of the datums before it are no wear
    band = measure_bands(on.patches, noise, max(error, TOLD) * tolerance)
    below = offset < -band
    return FittedDatum(
        twist=even @ moved[:count],
        radii=moved[count:],
        taken=even,
        weak=weak,
        gain=even @ gain[:count] @ on.patches.jacobian[:, :6],
        spread=even @ (vectors * np.sqrt(np.maximum(values, 0))),
        contact=float(weight[np.abs(offset) < band].sum() / weight.sum()),
        inside=float(weight[below].sum() / weight.sum()),
        off=float(-np.quantile(offset[below], 0.1)) if below.any() else 0.0,
        rms=float(np.sqrt(np.average(offset[chosen] ** 2, weights=weight[chosen]))) if chosen.any() else 0.0,
        points=on.points,
        error=error,
    )


def _leave_out(on: OnDatum, weak: Floats) -> FittedDatum:
    """A datum whose points fix nothing of what its shape would."""
    none = np.empty((6, 0))
    return FittedDatum(
        np.zeros(6), np.zeros(on.sizes), none, weak, np.zeros((6, 6)), none, 1.0, 0.0, 0.0, 0.0, on.points, ERRORS[0]
    )
