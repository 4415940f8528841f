"""What deformed parts of one type have in common: their mean form, how they differ, and how well one is predicted.

Principal components with missing data, as in morphable models (Luthi 2018): where a part was not seen, it is filled
with what the others say of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.transforms import find_nearest_motion, make_motions, move_points

ROUNDS = 6
"""Rounds in which parts are placed on the mean and filled where they were not seen."""
EFFECTIVE = 100.0
"""Independent values that the displacement of a part counts as, against the spread of the others."""
MOST = 8
"""Modes at most."""


@dataclass(frozen=True, eq=False)
class Family:
    """Parts of one type at places (N,3) on the skin as designed. ``moved`` (P,N,3): where each part has the places, in
    one frame, filled where it was not ``seen`` (P,N). ``mean`` (N,3) of them; ``modes`` (K,N,3): how they differ, each
    as one standard deviation; ``error``: deviation of a place that does not matter."""

    places: Floats
    moved: Floats
    seen: Flags
    mean: Floats
    modes: Floats
    error: float

    @property
    def count(self) -> Ints:
        """(N,) how many parts show each place."""
        return np.asarray(self.seen.sum(axis=0))


@dataclass(frozen=True, eq=False)
class Errors:
    """Cross-validation of a family: each part predicted from the others where some skin of it is hidden. ``beyond``
    (P,N,3): error of the prediction there, 0 elsewhere and on its own unseen skin. ``within``: root mean square
    residual along the normals, on the other skin."""

    beyond: Floats
    within: float


def build_family(places: Floats, moved: Floats, seen: Flags, error: float) -> Family:
    """The family of parts that have the places (N,3) at ``moved`` (P,N,3), each in a frame of its own. Where a part was
    not ``seen`` (P,N), its values do not count; where none was, they are all there is."""
    known = np.where(seen.any(axis=0), seen, True)
    current = np.array(moved)
    mean = current[int(seen.sum(axis=1).argmax())]
    modes = np.empty((0, *mean.shape))
    for _ in range(ROUNDS):
        for k in range(len(current)):
            T = find_nearest_motion(current[k], mean, known[k].astype(float))
            current[k] = move_points(current[k], T)
            if not known[k].all():
                filled, _ = predict(mean, modes, current[k], known[k], error)
                current[k] = np.where(known[k][:, None], current[k], filled)
        mean = np.asarray(current.mean(axis=0))
        modes = _find_modes(current, mean, places, error)
    return Family(places, current, seen, mean, modes, error)


def predict(
    mean: Floats, modes: Floats, moved: Floats, shown: Flags, error: float, normals: Floats | None = None
) -> tuple[Floats, Floats]:
    """Where a part has all places (N,3), in its own frame, and its coefficients (K,): from the places that are
    ``shown`` (N,) of ``moved`` (N,3), along the ``normals`` (N,3) alone where they are given, as a scan shows them."""
    directions = np.eye(3)[None].repeat(len(mean), axis=0) if normals is None else normals[:, None, :]
    used, coefficients, T = directions[shown], np.zeros(len(modes)), np.eye(4)
    weight = EFFECTIVE / max(len(used), 1) / error**2
    own = np.append(np.ones(len(modes)), np.zeros(6))
    for _ in range(3):
        now = move_points(mean + np.einsum("k,knc->nc", coefficients, modes), T)
        turned = np.einsum("knc,dc->knd", modes, T[:3, :3])
        columns = [np.einsum("ndc,nc->nd", used, mode[shown]) for mode in turned]
        turns = [np.einsum("ndc,nc->nd", used, np.cross(axis, now[shown])) for axis in np.eye(3)]
        columns += [*turns, *(used[:, :, axis] for axis in range(3))]
        matrix = np.stack(columns, axis=2).reshape(-1, len(own))
        target = np.einsum("ndc,nc->nd", used, moved[shown] - now[shown]).ravel()
        square = weight * matrix.T @ matrix + np.diag(own + 1e-12)
        right = weight * matrix.T @ target - own * np.append(coefficients, np.zeros(6))
        found: Floats = np.asarray(np.linalg.lstsq(square, right, rcond=1e-13)[0], np.float64)
        coefficients = coefficients + found[: len(modes)]
        T = make_motions(found[None, -6:])[0] @ T
    return move_points(mean + np.einsum("k,knc->nc", coefficients, modes), T), coefficients


def leave_one_out(family: Family, shown: Flags, normals: Floats) -> Errors:
    """How well each part of the family would have been predicted by the others if only the ``shown`` (N,) places of it
    had been scanned, along their normals (N,3)."""
    beyond, within = np.zeros_like(family.moved), []
    for k, part in enumerate(family.moved):
        others = np.arange(len(family.moved)) != k
        mean = np.asarray(family.moved[others].mean(axis=0))
        modes = _find_modes(family.moved[others], mean, family.places, family.error)
        known = shown & family.seen[k]
        guess, _ = predict(mean, modes, part, known, family.error, normals)
        off = part - guess
        within.append(np.einsum("nc,nc->n", off, normals)[known])
        hidden = family.seen[k] & ~shown
        beyond[k, hidden] = off[hidden]
    return Errors(beyond, float(np.sqrt((np.concatenate(within) ** 2).mean())))


def widen(count: int) -> float:
    """Factor by which a 95 % interval from the spread of so many parts is wider than from a known spread (Student's
    t)."""
    from scipy.stats import t

    return float(t.ppf(0.975, count - 1) / 1.96)


def _find_modes(moved: Floats, mean: Floats, places: Floats, error: float) -> Floats:
    """(K,N,3) the largest independent differences of parts from their mean. One part alone says only how it may be
    deformed: by more, less, or the other way."""
    count = len(moved)
    if count == 1:
        return np.asarray((mean - places)[None])
    _, size, shapes = np.linalg.svd((moved - mean).reshape(count, -1), full_matrices=False)
    size = size / np.sqrt(count - 1)
    most = min(MOST, max(count - 2, 1))
    kept = np.flatnonzero(size[:most] > error * np.sqrt(len(places)))
    return np.asarray((size[kept, None] * shapes[kept]).reshape(len(kept), *mean.shape))
