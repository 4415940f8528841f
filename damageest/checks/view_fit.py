"""Whether the views of a scan agree, and where each of them lies on the part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Scan
from damageest.checks.form_fields import choose_frame
from damageest.checks.form_fit import Form, Skin, find_feet, improve
from damageest.findings import ViewFit
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.transforms import move_points
from damageest.geometry.voxels import number_faced_cubes

COMPARED, FITTED = 30_000, 6_000
"""Points that views are compared with, in all, and points of a view that it is fitted with."""
REACH = 12.0
"""Distance from the skin, in tolerances, up to which points are used."""
WIDTHS = (8.0, 5.0, 3.0, 1.5, 0.7, 0.0)
"""Widths of the kernel, in tolerances, one after the other."""
NARROWEST, BY_NOISE = 0.3, 1.25
"""The last width: the larger of these, in tolerances and in standard deviations of the noise."""
APART = 0.4
"""Difference of a view from the others, in tolerances, in a fifth of their overlap, from which they disagree."""
FEWEST_OF_VIEW, FEWEST_SHARED = 4, 25
"""Points of a view in a cell, for its mean to be compared, and cells that it has to share with other views."""
FEWEST_POINTS = 300
"""Points near the part below which a view does not fix its pose."""
SHOWN = 2e-3
"""Mean square of the displacement along the normal, by a motion of size 1, from which the part shows the motion."""
CERTAIN = 0.15
"""Standard error of a view's pose, in tolerances at its worst point, up to which it is determined."""
HEALED = 0.6
"""Share of the disagreement that may be left after the views are fitted."""


@dataclass(frozen=True, eq=False)
class ViewFits:
    """The views, each with ``moves`` (V,4,4): the motion that puts it right, in the part's frame. ``disagree``: whether
    they differ by more than noise explains. ``common`` (4,4): the motion of the view that most others lie with, which
    is an error of the pose and not of views; shifts and turns of ``views`` are beyond it."""

    views: tuple[ViewFit, ...]
    moves: Floats
    disagree: bool
    common: Floats

    def apply(self, aligned: Scan) -> Scan:
        """The scan with corrected views: the corrected ones by their own motion, the others by the common one."""
        assert aligned.view is not None
        assert aligned.viewpoints is not None
        points, scanners = aligned.points.copy(), aligned.viewpoints.copy()
        for one in self.views:
            move = self.moves[one.number] if one.is_corrected else self.common
            own = aligned.view == one.number
            points[own] = move_points(points[own], move)
            scanners[one.number] = move[:3, :3] @ scanners[one.number] + move[:3, 3]
        other = aligned.view < 0
        points[other] = move_points(points[other], self.common)
        return replace(aligned, points=points, viewpoints=scanners)


def fit_views(part: Part, aligned: Scan, tolerance: float, is_correcting: bool) -> ViewFits | None:
    """Compares the views where they overlap, and where they disagree, fits each of them to the part by itself.

    ``aligned``: the scan in the part's frame. ``is_correcting``: views that are determined by themselves and lie
    elsewhere are corrected. None for a scan without views, or of a single one. A part that is bent or of another size
    shows as such: its views agree where they overlap.
    """
    if aligned.view is None or aligned.viewpoints is None or len(aligned.viewpoints) < 2:
        return None
    skin, count = Skin.build(part), len(aligned.viewpoints)
    gap = float(np.sqrt(part.area / COMPARED))
    index = [_draw(aligned, number, gap) for number in range(count)]
    where = np.concatenate(index)
    if len(where) < FEWEST_POINTS:
        return None
    points, view = aligned.points[where], np.asarray(aligned.view[where], np.int64)
    before = _compare(skin, points, view, count, gap, tolerance)
    moves = np.tile(np.eye(4), (count, 1, 1))
    known = np.nan_to_num(before)
    if not (known > APART * tolerance).any():
        return ViewFits((), moves, False, np.eye(4))
    frame = choose_frame(part, points)
    determined = np.zeros(count, bool)
    width = max(NARROWEST * tolerance, BY_NOISE * aligned.noise)
    shown = _find_shown(skin, Form.rigid(frame), points, gap, tolerance)
    for number in range(count):
        own = points[view == number]
        form, determined[number] = _fit_one(skin, Form.rigid(frame), own, shown, gap, width, tolerance)
        moves[number] = form.T if determined[number] else np.eye(4)
    moved = points.copy()
    for number in range(count):
        own = view == number
        moved[own] = points[own] @ moves[number, :3, :3].T + moves[number, :3, 3]
    after = np.nan_to_num(_compare(skin, moved, view, count, gap, tolerance))
    healed = float(after.max()) < max(HEALED * float(known.max()), APART * tolerance)
    common = _choose_common(moves, determined, np.bincount(view, minlength=count), part.bounds) if healed else np.eye(4)
    normals = skin.find_feet(moved)[2]
    views = []
    for number in range(count):
        own = view == number
        at = move_points(points[own], common)
        along = np.einsum("ij,ij->i", moved[own] - at, normals[own])
        far = float(np.quantile(np.abs(along), 0.9)) if own.any() else 0.0
        elsewhere = bool(healed and determined[number] and far > APART / 2 * tolerance)
        shift, turn = _describe_motion(
            moves[number] @ np.linalg.inv(common) if determined[number] else np.eye(4), frame.centre
        )
        views.append(
            ViewFit(
                number, shift, turn, float(known[number]), float(after[number]), bool(determined[number]),
                elsewhere and is_correcting,
            )
        )  # fmt: skip
    return ViewFits(tuple(views), moves, True, common)


def _draw(aligned: Scan, number: int, gap: float) -> Ints:
    """Points of one view, spread evenly over what it shows."""
    own = np.flatnonzero(aligned.view == number)
    return own[pick_one_per_cube(aligned.points[own], gap)] if len(own) else own


def _compare(skin: Skin, points: Floats, view: Ints, count: int, gap: float, tolerance: float) -> Floats:
    """How far each view (V,) lies from the others where they overlap, in a fifth of it; NaN where it does not."""
    distance, places, normals = skin.find_feet(points)
    offset = np.einsum("ij,ij->i", normals, points - places)
    used = (distance < REACH * tolerance) & (np.abs(np.abs(offset) - distance) < 0.1 * tolerance)
    cell = np.unique(number_faced_cubes(places[used], normals[used], 5 * gap)[1], return_inverse=True)[1]
    cells = int(cell.max(initial=-1)) + 1
    total = np.bincount(cell * count + view[used], minlength=cells * count).reshape(-1, count).astype(np.float64)
    sums = np.bincount(cell * count + view[used], offset[used], cells * count).reshape(-1, count)
    mean = np.where(total >= FEWEST_OF_VIEW, sums / np.maximum(total, 1), np.nan)
    apart = np.full(count, np.nan)
    for number in range(count):
        others = np.delete(mean, number, axis=1)
        shared = np.isfinite(mean[:, number]) & np.isfinite(others).any(axis=1)
        if shared.sum() >= FEWEST_SHARED:
            difference = np.abs(mean[shared, number] - np.nanmedian(others[shared], axis=1))
            apart[number] = float(np.quantile(difference, 0.8))
    return apart


def _fit_one(
    skin: Skin, form: Form, points: Floats, shown: Floats, gap: float, width: float, tolerance: float
) -> tuple[Form, bool]:
    """The rigid motion of one view, and whether its points determine it."""
    points = points[:: max(1, len(points) // FITTED)]
    edge = 4 * gap
    for wide in WIDTHS:
        feet = find_feet(skin, form, points, edge, REACH * tolerance, tolerance)
        if len(feet.points) < FEWEST_POINTS:
            return form, False
        for _ in range(2):
            cells = feet.summarise(form)
            if len(cells.count) < 12:
                return form, False
            form = improve(form, cells, max(wide * tolerance, width), tolerance)
    worst = float(np.sqrt(np.linalg.eigvalsh(shown.T @ form.covariance @ shown)[-1]))
    return form, worst < CERTAIN * tolerance


def _find_shown(skin: Skin, form: Form, points: Floats, gap: float, tolerance: float) -> Floats:
    """(6,S) the motions that the whole scan shows: a turn of a shaft about its axis is not among them."""
    cells = find_feet(skin, form, points, 4 * gap, REACH * tolerance, tolerance).summarise(form)
    weight = cells.count / cells.count.sum()
    size, motions = np.linalg.eigh(cells.jacobian.T @ (cells.jacobian * weight[:, None]))
    return np.asarray(motions[:, size > SHOWN])


def _choose_common(moves: Floats, determined: Flags, count: Ints, bounds: Floats) -> Floats:
    """The motion (4,4) of the view that lies nearest to the others: the median of the motions of determined views."""
    if not determined.any():
        return np.eye(4)
    corner = np.array([[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]])
    chosen = np.flatnonzero(determined)
    ends = corner @ np.swapaxes(moves[chosen, :3, :3], 1, 2) + moves[chosen, None, :3, 3]
    apart = np.linalg.norm(ends[:, None] - ends[None], axis=3).mean(axis=2)
    return np.asarray(moves[chosen[int(np.argmin((apart * count[chosen]).sum(axis=1) - 1e-9 * count[chosen]))]])


def _describe_motion(move: Floats, centre: Floats) -> tuple[Floats, float]:
    """The shift (3,) of the part's centre by a motion (4,4), and its turn in degrees."""
    from scipy.spatial.transform import Rotation

    return move[:3, :3] @ centre + move[:3, 3] - centre, float(
        np.degrees(Rotation.from_matrix(move[:3, :3]).magnitude())
    )
