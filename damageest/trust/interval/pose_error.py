"""How exactly the intact skin fixes the pose, and how far it deviates from the part over whole areas.

The mean distances of patches of intact skin are compared with the part. What the noise does not explain is systematic:
form of the part, or of the scanner. It limits the pose as well, since a patch then counts as few points, not as many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from damageest.artefacts import INTACT, Flags, Floats, FreeMotion
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField

PATCH = 1 / 15
"""Edge of a patch of skin, in diagonals of the part."""
FEWEST_POINTS, FEWEST_PATCHES = 8, 12
"""Points of a patch, and patches, for their mean distances to be compared."""
MOST_POINTS = 200_000
"""Intact points that are used; more do not change the second digit."""
ROUNDS = 10
"""Rounds of the robust fit."""
LAGS = 10
"""Distance, in edges of a patch, up to which patches are compared for how far they deviate alike."""
ALIKE = 0.1
"""Correlation from which on patches count as independent."""
MOST_PATCHES = 1500
"""Patches that are compared in pairs."""
MOST_TRIANGLES = 400
"""Places of a footprint that are compared in pairs."""
SIGNIFICANT = 22.5
"""Square of a deviation of the pose, in its standard deviations, from which it is real: one in a thousand by chance, of
six degrees of freedom."""


@dataclass(frozen=True, eq=False)
class PoseError:
    """The error of the pose, and of the form of skin that is intact.

    ``spread`` (6,K): columns of independent errors, one standard deviation each, of a small motion of the scan in the
    part's frame: rotation about ``centre`` (3,) in radians, then shift. ``systematic``: standard deviation of the mean
    distances of patches of intact skin that noise does not explain; ``patch_area``: area over which it is common, from
    the correlation of patches with their distance (as of a semivariogram): ``alike`` (L,) at distances of 1, 2, ...
    ``edge``, 0 beyond the last. ``by_offset``, ``by_scale`` (6,): the motion that the fit finds for each unit by which
    all of the scan lies outside, and for each share by which it is scaled about ``centre``; 0 for one that was given.
    """

    centre: Floats
    spread: Floats
    systematic: float
    patch_area: float
    by_offset: Floats = field(default_factory=lambda: np.zeros(6))
    by_scale: Floats = field(default_factory=lambda: np.zeros(6))
    alike: Floats = field(default_factory=lambda: np.empty(0))
    edge: float = 0.0

    def leave_out(self, motions: Sequence[FreeMotion], radius: float) -> PoseError:
        """The error without what lies along free ``motions``: these are swept, and the same cause is not counted twice.
        ``radius``: distance at which a turn counts like a shift."""
        if not motions:
            return self
        scale = np.array([radius] * 3 + [1.0] * 3)
        turns = [np.asarray(one.direction) * one.turn if one.point is not None else np.zeros(3) for one in motions]
        shifts = [one.move(self.centre[None])[0] for one in motions]
        ways = scale[:, None] * np.concatenate([np.array(turns), np.array(shifts)], axis=1).T
        along = np.linalg.qr(ways)[0]
        spread = scale[:, None] * self.spread
        return replace(self, spread=(spread - along @ (along.T @ spread)) / scale[:, None])

    def measure_common(self, places: Floats, areas: Floats) -> float:
        """Share of the systematic error that is common to a footprint, as a standard deviation: the root of the mean of
        its correlation over all pairs of places (F,3), each with its area (F,) (JCGM 100, 5.2.2). 1 for a site that is
        small against the distance over which errors are alike, and where that is not known."""
        total = float(areas.sum())
        if self.edge <= 0 or len(places) < 2 or total <= 0:
            return 1.0
        from scipy.spatial.distance import pdist

        rng = np.random.default_rng(0)
        some = places[rng.choice(len(places), MOST_TRIANGLES, p=areas / total)]
        lags = self.edge * np.arange(len(self.alike) + 2)
        return float(np.sqrt(np.interp(pdist(some), lags, [1.0, *self.alike, 0.0]).mean()))

    def of_volume(self, damage_skin: Floats, normals: Floats, areas: Floats) -> Floats:
        """The errors (K,) of a volume, one for each column of ``spread``.

        Args:
            damage_skin: (F,3) centres of the triangles of the skin that the damage volume removes.
            normals, areas: (F,3), (F,) their outward unit normals and areas.

        A small motion v of the inner surface changes the volume by the integral of v.n over it. The flux of a rigid
        motion through a closed surface is 0, so this is minus the integral over the skin, which is exact on triangles.
        """
        rows = make_rows(damage_skin - self.centre, normals)
        return np.asarray(-(areas @ rows) @ self.spread)

    def of_motion(self, motion: Floats, damage_skin: Floats, normals: Floats, areas: Floats) -> float:
        """Change of a volume by a small ``motion`` (6,) of the scan; the others as in `of_volume`."""
        return -float(areas @ make_rows(damage_skin - self.centre, normals) @ motion)

    def move_distance(self, motion: Floats, place: Floats, normal: Floats) -> float:
        """Change of the signed distance of a place (3,) to the skin with the outward ``normal`` (3,) by a small
        ``motion`` (6,) of the scan."""
        return float(make_rows(place[None] - self.centre, normal[None])[0] @ motion)

    def of_distance(self, place: Floats, normal: Floats) -> float:
        """Standard deviation of the signed distance of a place (3,) to the skin with the outward ``normal`` (3,)."""
        row = make_rows(place[None] - self.centre, normal[None])[0]
        return float(np.linalg.norm(row @ self.spread))


def measure_pose_error(
    field: ScanField,
    form: float = 0.0,
    spread: Floats | None = None,
    held: bool = False,
    fixing: Flags | None = None,
) -> PoseError:
    """The error that the intact points leave to the pose.

    Args:
        field: that of the whole scan, N points.
        form: standard deviation by which the skin is known to deviate; the measured one where it is larger.
        spread: (6,K) errors of a pose that was fitted to datums, as in `Pose`: not all of the skin fixes it.
        held: whether the pose was given: no error of the scan moves it.
        fixing: (N,) which points lie on the datums that fix the pose; None: all of the skin does.

    No direction of the pose is taken to be worse than the tolerance: a larger error would show as damage. Turning a
    part of revolution about its axis changes no volume, though no point fixes it.
    """
    part, noise, tolerance = field.part, field.aligned.noise, field.tolerance
    centre = part.bounds.mean(axis=0)
    edge = PATCH * part.diagonal
    radius = max(part.diagonal / 4, 1e-12)
    scale = np.diag([1 / radius] * 3 + [1.0] * 3)
    intact = field.label == INTACT
    mean, places, rows, height, count = _average_patches(field, intact, centre, edge)
    if len(mean) < FEWEST_PATCHES:
        return PoseError(centre, tolerance * scale, max(form, 0.0), edge**2)
    rows = rows @ scale
    prior = np.eye(6) / tolerance**2
    variance = np.maximum(noise**2 / count, (1e-6 * part.diagonal) ** 2)
    motion: Floats = np.zeros(6)
    systematic, left, weights = 0.0, mean, np.ones(len(mean))
    for _ in range(ROUNDS):
        trust = weights / (variance + systematic**2)
        weighted = (rows * trust[:, None]).T
        motion = np.asarray(np.linalg.solve(weighted @ rows + prior, weighted @ mean))
        left = mean - rows @ motion
        systematic = _measure_excess(left, variance)
        limit = 3 * np.sqrt(variance + systematic**2)
        weights = np.minimum(1, limit / np.maximum(np.abs(left), 1e-300))
    alike = _correlate(left, places, systematic, edge)
    area = edge**2 * (1 + float(2 * np.pi * np.arange(1, len(alike) + 1) @ alike))
    systematic = max(systematic, form)
    if held:
        answers: Floats = np.zeros((2, 6))
    elif fixing is None:
        answers = _find_answers(rows, height, weights / (variance + systematic**2), prior) @ scale
    else:
        _, _, own_rows, own_height, own_count = _average_patches(field, intact & fixing, centre, edge)
        answers = _find_answers(own_rows @ scale, own_height, own_count / max(noise, 1e-9) ** 2, prior) @ scale
    information = (rows / (variance + systematic**2)[:, None]).T @ rows + prior
    covariance = np.linalg.inv(information)
    values, vectors = np.linalg.eigh(covariance)
    errors = scale @ (vectors * np.sqrt(np.maximum(values, 0)))
    if motion @ information @ motion > SIGNIFICANT:
        errors = np.column_stack([errors, scale @ motion])
    if spread is not None:
        errors = np.column_stack([errors, spread])
    return PoseError(centre, errors, systematic, area, answers[0], answers[1], alike, edge)


def _find_answers(rows: Floats, height: Floats, trust: Floats, prior: Floats) -> Floats:
    """The motions (2,6) that a fit with weights ``trust`` (P,) finds where each patch lies outside by 1, as by an
    offset, and by its ``height`` (P,) over the centre, as by a scale."""
    weighted = (rows * trust[:, None]).T
    asked = np.stack([np.ones(len(rows)), height], axis=1)
    return np.asarray(np.linalg.solve(weighted @ rows + prior, weighted @ asked).T)


def make_rows(places: Floats, normals: Floats) -> Floats:
    """(N,6) change of the signed distance of places (N,3) with a rotation about the origin, and with a shift."""
    return np.concatenate([np.cross(places, normals), normals], axis=1)


def _average_patches(
    field: ScanField, chosen: Flags, centre: Floats, edge: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Mean distance (P,) of patches of the ``chosen`` (N,) points, their places (P,3), mean rows (P,6) of `make_rows`,
    mean height (P,) along the normal over the centre, and number of points (P,)."""
    index = np.flatnonzero(chosen)
    step = max(1, -(-len(index) // MOST_POINTS))
    index = index[::step]
    if not len(index):
        return np.empty(0), np.empty((0, 3)), np.empty((0, 6)), np.empty(0), np.empty(0)
    normals = field.find_normals(index)
    places = field.points[index] - centre
    patches = Patches.on_skin(places, normals, edge)
    enough: Flags = patches.count >= FEWEST_POINTS
    height = np.einsum("ij,ij->i", places, normals)
    mean, mean_places, mean_rows, mean_height = (
        patches.mean(values)[enough] for values in (field.distance[index], places, make_rows(places, normals), height)
    )
    return mean, mean_places, mean_rows, mean_height, step * patches.count[enough].astype(np.float64)


def _measure_excess(left: Floats, variance: Floats) -> float:
    """The standard deviation that the ``variance`` (P,) of patches does not explain in what is ``left`` (P,), robustly;
    0 where it is within chance."""
    size = left**2 / variance / 0.4549  # the median of a square of a normal variable
    ratio = float(np.median(size))
    chance = 1 + 2.5 * 1.6 / np.sqrt(len(left))
    return float(np.sqrt(max(ratio - chance, 0.0) * np.median(variance)))


def _correlate(left: Floats, places: Floats, systematic: float, edge: float) -> Floats:
    """The correlation (L,) of what is ``left`` (P,) of patches at ``places`` (P,3), at distances of 1, 2, ... edges, up
    to the first at which they are independent."""
    if not systematic:
        return np.empty(0)
    from scipy.spatial.distance import pdist

    some = np.random.default_rng(0).permutation(len(left))[:MOST_PATCHES]
    value = np.clip(left[some], -3 * systematic, 3 * systematic)
    lag = np.rint(pdist(places[some]) / edge).astype(np.int64)
    first, second = np.triu_indices(len(some), 1)
    near = (lag >= 1) & (lag <= LAGS)
    count = np.bincount(lag[near], minlength=LAGS + 1)
    product = np.bincount(lag[near], weights=(value[first] * value[second])[near], minlength=LAGS + 1)
    alike = product[1:] / np.maximum(count[1:], 1) / systematic**2
    independent = np.flatnonzero(alike < ALIKE)
    return np.asarray(np.clip(alike[: independent[0]] if len(independent) else alike, 0, 1))
