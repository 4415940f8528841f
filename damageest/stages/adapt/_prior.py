"""What other parts of the type say about a part: the form to start from, and how well skin that is lost is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Flags, Floats, Part, PriorUse, Scan, fit_scattered
from damageest.errors import StageError
from damageest.geometry.families import Errors, Family, leave_one_out, widen
from damageest.geometry.transforms import make_motions, move_points
from damageest.io.forms import PLACES, SMALL, SMOOTH, MeasuredForm, gather_family, read_form, require_type
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._choose import cut_patches
from damageest.stages.adapt._field import Body, Field, match, weigh
from damageest.stages.adapt._posterior import BEYOND, find_spacing, go_beyond

FEW = 3
"""Parts that have to show a place, for their spread to say how well it is known."""
STRANGE = 0.3
"""What a part may have left on seen skin, in tolerances, and still be of the type, however alike the others are."""
OUTSIDE = 3.0
"""How many times as much as the others it may have left."""
RARE = 0.99
"""Share of the parts of a type whose coefficients are nearer to the mean than those of one that is none of them."""
EFFECTIVE = 300.0
"""Independent points that a scan counts as, against the spread of the parts."""
KEPT = 40
"""Independent errors that are kept of many parts."""
CELLS = 4
"""Cells, along the longest edge of the box, of the lattice that holds the form of the type, at least."""


@dataclass(frozen=True, eq=False)
class Start:
    """The form that other parts of the type predict.

    ``field``: of the part as designed, about its centre; ``mean``: of the type; ``motion`` (4,4) takes the scan's
    points, about the centre, onto the field. ``family``: the other parts; ``shown`` (N,): whether the scan shows skin
    at each of its places; ``errors``: how well each of the parts is predicted from the others where the scan shows no
    skin, None where they are too few; ``factor``: by how much wider this is for a 95 % interval, since there are few,
    and since the part is less like them than they are. ``used``: what the result says of it.
    """

    field: Field
    mean: Field
    motion: Floats
    family: Family
    shown: Flags
    errors: Errors | None
    factor: float
    used: PriorUse

    def find_held(self, count: int) -> Floats:
        """(H,3) points on the predicted skin where the scan shows none and enough of the others do: as many for an area
        as a scan of ``count`` points has. They hold a field that follows the rest of the scan."""
        if self.errors is None:
            return np.empty((0, 3))
        held = self.family.places[~self.shown & (self.family.count >= FEW)]
        return np.repeat(self.field.move(held), max(1, round(count / PLACES)), axis=0)

    def go_beyond(self, places: Floats, seen: Floats, spacing: float, own: Floats | None, left: Floats) -> Floats:
        """(K,V,3) independent errors at places (V,3) of the skin as designed beyond the ``seen`` places (N,3). ``own``
        (V,3): what seen skin adds to the form of the type, which may not go on; ``left`` (V,3): what is left on seen
        skin after that, since as much may be left there."""
        from scipy.spatial import cKDTree

        if self.errors is None:
            return np.asarray(BEYOND * go_beyond(places, seen, spacing))[None]
        count = self.family.count
        known = self.family.places[count >= FEW]
        apart = 2 * float(np.median(np.asarray(cKDTree(self.family.places).query(self.family.places, 2)[0])[:, 1]))
        rest = BEYOND * go_beyond(places, np.concatenate([seen, known]), max(spacing, 2 * apart))
        each = self.factor * self.errors.beyond / np.sqrt(np.maximum(count, 1))[:, None]
        distance, near = (np.asarray(one) for one in cKDTree(self.family.places).query(places, 4))
        weight = 1 / np.maximum(distance, 1e-6 * apart)
        weight /= weight.sum(axis=1, keepdims=True)
        off, _ = cKDTree(seen).query(places)
        share = np.clip(off / spacing - 1, 0.0, 1.0)
        # what the lattice does not hold of the mean
        unheld = self.family.mean - self.family.places - self.mean.displace(self.family.places)
        each = np.concatenate([each, unheld[None]])
        if len(each) > KEPT:
            _, size, shapes = np.linalg.svd(each.reshape(len(each), -1), full_matrices=False)
            each = (size[:KEPT, None] * shapes[:KEPT]).reshape(KEPT, *each.shape[1:])
        spread = np.einsum("vn,pvnc->pvc", weight, each[:, near]) * share[:, None]
        more = [(share[:, None] * one)[None] for one in (own, left) if one is not None]
        return np.concatenate([spread, *more, rest[None]])


def read_prior(paths: Sequence[Path], part: Part, scan: Scan) -> list[MeasuredForm]:
    """The forms of other parts of the type. Raises InputError for a file that is none, and StageError where no other
    part is among them: a part is no evidence for itself."""
    forms = [read_form(path) for path in paths]
    require_type(forms, part)
    others = [form for form in forms if not form.is_of(scan)]
    if not others:
        raise StageError(
            "prior: all files come from this scan, but other parts are needed",
            "give the files of other parts of the type, or remove prior",
        )
    return others


def start_from(
    forms: Sequence[MeasuredForm], part: Part, points: Floats, body: Body, scales: Sequence[float], tolerance: float
) -> Start:
    """The form that the parts predict for the one with these points (N,3) about the centre: their mean, and how they
    differ, as seen skin shows it. A part as they are not is said to be one (``used.is_used``)."""
    family, normals = gather_family(forms, part, SMALL * tolerance)
    basis = replace(body.basis, cells=max(CELLS, *(max(form.field.cells) for form in forms)))
    shapes = (family.mean - family.places, *family.modes)
    mean, *modes = [_fit_lattice(shape, family.places, basis) for shape in shapes]
    field, motion, coefficients = _place(mean, modes, points, body, scales)
    found = match(field, move_points(points, motion), body)
    weights = weigh(found, scales[-1], body.noise)
    seen = found.material[(np.abs(found.distance) < tolerance) & (weights > 0)]
    misfit = _measure_misfit(found.distance, weights, points, body)
    off = _find_distance(family.places, seen)
    shown = off <= find_spacing(body, points) + float(np.sqrt(part.area / PLACES))
    count = len(forms)
    enough = count >= FEW and bool(shown.any())
    errors = leave_one_out(family, shown, normals) if enough else None
    within = errors.within if errors else 0.0
    limit = max(STRANGE * tolerance, OUTSIDE * within)
    is_alike = misfit <= limit and _are_usual(coefficients, count)
    stretch = max(misfit / max(within, SMALL * tolerance), 1.0)
    factor = stretch * widen(count) if enough else 1.0
    return Start(field, mean, motion, family, shown, errors, factor, PriorUse(count, misfit, limit, is_alike))


def describe_prior(start: Start, tolerance: float, unit: str) -> str:
    """What is said of the other parts of the type."""
    used = start.used
    parts = f"{used.parts} other part{'' if used.parts == 1 else 's'} of the type"
    if not used.is_used:
        return (
            f"the form of {parts} was not used: this part deforms in another way (residual {used.misfit:.3g} "
            f"{unit} on its seen skin, usually up to {used.limit:.3g} {unit}); its own skin alone predicts lost skin"
        )
    words = f"the form was predicted from {parts} (residual {used.misfit:.3g} {unit} on its seen skin)"
    if start.errors is None:
        return f"{words}; too few to narrow the interval of lost skin: give {FEW} or more"
    unshown = float((start.family.count < FEW).mean())
    if unshown > 0.005:
        words += f"; fewer than {FEW} of them show {100 * unshown:.2g} % of the skin, whose interval stays as wide"
    return words


def _find_distance(places: Floats, seen: Floats) -> Floats:
    """(N,) from places to the nearest of the seen ones; infinite where there are none."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(seen).query(places)[0]) if len(seen) else np.full(len(places), np.inf)


def _fit_lattice(displacement: Floats, places: Floats, basis: Basis) -> Field:
    """The field that has this displacement (N,3) at places (N,3) on the skin, and goes on smoothly."""
    half = basis.half * basis.size
    cells = basis.shape_of_cells
    field = fit_scattered(places, displacement, basis.centre - half, basis.centre + half, cells, SMOOTH)
    return Field(basis, field.controls.reshape(-1, 3))


def _place(
    mean: Field, modes: Sequence[Field], points: Floats, body: Body, scales: Sequence[float]
) -> tuple[Field, Floats, Floats]:
    """The field of the type, the rigid motion (4,4) of the points and the coefficients (K,) that fit the points: robust
    and one-sided as any field, with the spread of the parts as their prior."""
    coefficients, T = np.zeros(len(modes)), np.eye(4)
    shapes = np.array([mode.coefficients for mode in modes]).reshape(len(modes), *mean.coefficients.shape)
    field = mean
    for scale in scales:
        moved = move_points(points, T)
        found = match(field, moved, body)
        weights = weigh(found, scale, body.noise)
        columns = [np.einsum("nc,nc->n", found.normal, mode.displace(found.material)) for mode in modes]
        turns = np.cross(moved, found.normal)
        matrix = np.column_stack([*columns, -turns, -found.normal])
        own = np.append(np.ones(len(modes)), np.zeros(6))
        weight = weights * min(1.0, EFFECTIVE / len(points)) / max(body.noise, scale / 3) ** 2
        square = matrix.T @ (matrix * weight[:, None]) + np.diag(own)
        right = matrix.T @ (weight * found.distance) - own * np.append(coefficients, np.zeros(6))
        step: Floats = np.asarray(np.linalg.lstsq(square, right, rcond=1e-13)[0], np.float64)
        coefficients = coefficients + step[: len(modes)]
        T = make_motions(step[None, -6:])[0] @ T
        field = Field(mean.basis, mean.coefficients + np.einsum("k,kmc->mc", coefficients, shapes))
    return field, T, coefficients


def _measure_misfit(distance: Floats, weights: Floats, points: Floats, body: Body) -> float:
    """Root mean square of the means of patches of skin, less what noise makes of them. Patches of which most is damaged
    do not count."""
    patch, _ = cut_patches(points, body.mesh.diagonal)
    total, size = np.bincount(patch, weights), np.bincount(patch)
    kept = (total > 5) & (total > 0.4 * size)
    if not kept.any():
        return float(np.sqrt((weights * distance**2).sum() / max(weights.sum(), 1e-300)))
    mean = np.bincount(patch, weights * distance)[kept] / total[kept]
    return float(np.sqrt(max((mean**2 - body.noise**2 / total[kept]).mean(), 0.0)))


def _are_usual(coefficients: Floats, count: int) -> bool:
    """Whether coefficients (K,), in standard deviations of ``count`` parts, are those of one more of them: by
    Hotelling's statistic, which is wide for few parts."""
    from scipy.stats import f

    modes = len(coefficients)
    if count < FEW or not modes or count <= modes:
        return True
    limit = modes * (count**2 - 1) / (count * (count - modes)) * float(f.ppf(RARE, modes, count - modes))
    return bool(coefficients @ coefficients <= limit)
