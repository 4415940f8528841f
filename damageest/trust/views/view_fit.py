"""Whether the views of a scan agree, and where each of them lies on the part."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Scan
from damageest.findings import ViewFit
from damageest.geometry.distance import signed_distance
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField
from damageest.geometry.transforms import move_points
from damageest.trust.form.form_fields import FieldFrame, choose_frame
from damageest.trust.form.form_fit import Skin, make_motion
from damageest.trust.views.view_joint import JointFit, ViewPoints, fit_jointly

COMPARED = 30_000
"""Points that views are compared with, in all."""
REACH = 12.0
"""Distance from the skin, in tolerances, up to which points are used."""
NARROWEST, BY_NOISE = 0.3, 1.25
"""The last width of the kernel: the larger of these, in tolerances and in standard deviations of the noise."""
APART = 0.4
"""Difference of a view from the others, in tolerances, in a fifth of their overlap, from which they disagree."""
OF_NOISE = 0.8
"""The same in noises, where these are large: means of a few points differ."""
FEWEST_OF_VIEW, FEWEST_SHARED = 4, 25
"""Points of a view in a cell, for its mean to be compared, and cells that it has to share with other views."""
EVEN, EVEN_NOISE = 0.6, 2.0
"""Standard deviation of the points of a view in a cell, up to which they show its skin: the larger of these, in
tolerances and in noises."""
FEWEST_POINTS = 300
"""Points near the part below which a view is not fitted."""
HELD = 0.5
"""Motions of a view that are held, of six, up to which its pose is determined."""
HEALED = 0.6
"""Share of the disagreement that may be left after the views are fitted."""
KEPT = 0.5
"""Share of what the motions explain that they have to explain where they were not fitted."""
EXPLAINED = 2.5
"""Depth of a point, in distances of its view from the others, up to which the view may be the cause."""
COMMON = 0.75
"""Motion of all views together, in the largest distance of a view from the others, from which it is not the pose that a
misplaced view has pulled away: skin is worn, and the stage align has weighed that."""
FREE = 0.25
"""Share of a shift of the skin along its normal, squared, that nothing shows, from which it is not known."""
AMBIGUOUS = 0.5
"""Motion outward, in tolerances, that only the part shows, from which skin that one view sees may be worn instead."""
FoundBy = Literal["given", "order", "sheets"]


@dataclass(frozen=True, eq=False)
class ViewFits:
    """The views, each with ``moves`` (V,4,4): the motion that puts it right, in the part's frame. ``disagree``: whether
    they differ by more than noise explains. ``common`` (4,4): the motion of the view that most others lie with, which
    is an error of the pose and not of views; shifts and turns of ``views`` are beyond it.

    ``label`` (N,): the view of each point, -1 for a point of none. ``found_by``: whether the scan says which points
    belong together (`given`), or their order or two surfaces over the same skin (`order`, `sheets`) do. ``hidden``:
    volume of metal that may be worn off where views were moved as only the part shows. ``free`` (V,6,6): projection of
    the motions of each view, in ``frame``, onto those that nothing shows."""

    views: tuple[ViewFit, ...]
    moves: Floats
    disagree: bool
    common: Floats
    label: Ints
    found_by: FoundBy = "given"
    hidden: float = 0.0
    free: Floats = field(default_factory=lambda: np.empty((0, 6, 6)))
    frame: FieldFrame | None = None

    def apply(self, aligned: Scan) -> Scan:
        """The scan with corrected views: the corrected ones by their own motion, the others by the common one."""
        points, every = aligned.points.copy(), np.ones(len(aligned.points), bool)
        scanners = None if aligned.viewpoints is None else aligned.viewpoints.copy()
        places = [(self.label == one.number, self.get_move(one)) for one in self.views]
        for own, _ in places:
            every &= ~own
        for own, move in [(every, self.common), *places]:
            points[own] = move_points(points[own], move)
            if scanners is not None and aligned.view is not None and aligned.viewpoints is not None:
                # a scanner moves with its view; where points of one scanner move in two ways, the last one counts
                seen = np.unique(aligned.view[own])
                seen = seen[seen >= 0]
                scanners[seen] = move_points(aligned.viewpoints[seen], move)
        return replace(aligned, points=points, viewpoints=scanners)

    def find_explained(self, field: ScanField, members: Ints) -> float:
        """Share of the points ``members`` (M,) of a site that a misplaced view explains: its own motion, which was not
        made, brings them onto the skin; or nothing shows how far that view is off there, and it may be as far as they
        are deep."""
        if not self.disagree or not len(members):
            return 0.0
        depth, label, tolerance = -field.distance[members], self.label[members], field.tolerance
        explained = np.zeros(len(members), bool)
        for one in self.views:
            own = label == one.number
            if not own.any():
                continue
            at, normals = field.points[members[own]], field.find_normals(members[own])
            if one.is_elsewhere and not one.is_corrected:
                back = move_points(at, self.moves[one.number])
                explained[own] |= signed_distance(back, field.part)[0] > -tolerance
            is_near = depth[own] < EXPLAINED * one.apart
            if one.is_elsewhere and self.frame is not None:
                rows = self.frame.list_motions(at, normals)
                is_free = np.einsum("ni,ij,nj->n", rows, self.free[one.number], rows) > FREE
                explained[own] |= is_free & is_near
            if not one.is_corrected and one.left > APART * tolerance:
                explained[own] |= depth[own] < EXPLAINED * one.left
        return float(explained.mean())

    def get_move(self, view: ViewFit) -> Floats:
        """The motion (4,4) of one view: its own where it is corrected."""
        return np.asarray(self.moves[view.number] if view.is_corrected else self.common)


def number_views(aligned: Scan) -> Ints | None:
    """The number (N,) of the view of each point, -1 where it is not known; None for a scan that does not say it, or of
    a single view."""
    label = aligned.view if aligned.cloud is None else aligned.cloud
    if label is None or len(label) == 0:
        return None
    known = np.unique(label[label >= 0])
    return np.asarray(label, np.int64) if len(known) > 1 else None


def fit_views(
    part: Part, aligned: Scan, tolerance: float, is_correcting: bool, label: Ints | None = None,
    found_by: FoundBy = "given",
) -> ViewFits | None:  # fmt: skip
    """Compares the views where they overlap, and where they disagree, fits them to each other and to the part.

    ``aligned``: the scan in the part's frame. ``is_correcting``: views that lie elsewhere are corrected, as far as the
    skin that they show fixes their motions. ``label`` (N,): the view of each point, as `separate_views` found it; else
    what the scan says. Views that two surfaces tell apart are not corrected: where one of them alone shows the skin,
    nothing says which it is. None for a scan of a single view. A part that is bent or of another size shows as such:
    its views agree where they overlap.
    """
    label = number_views(aligned) if label is None else label
    if label is None:
        return None
    is_correcting &= found_by != "sheets"
    skin, count = Skin.build(part), int(label.max()) + 1
    gap = float(np.sqrt(part.area / COMPARED))
    where = np.concatenate([_draw(aligned, label, number, gap) for number in range(count)])
    if len(where) < FEWEST_POINTS:
        return None
    points, view = aligned.points[where], label[where]
    even = max(EVEN * tolerance, EVEN_NOISE * aligned.noise)
    before = _compare(skin, points, view, count, gap, tolerance, even)
    agreed = ViewFits((), np.tile(np.eye(4), (count, 1, 1)), False, np.eye(4), label, found_by)
    known = np.nan_to_num(before)
    least = max(APART * tolerance, OF_NOISE * aligned.noise)
    if not (known > least).any():
        return agreed
    frame = choose_frame(part, points)
    width = max(NARROWEST * tolerance, BY_NOISE * aligned.noise)
    many = np.bincount(view, minlength=count) >= FEWEST_POINTS
    used = many[view]
    seen = ViewPoints(points[used], view[used], count)
    fit = fit_jointly(skin, frame, seen, gap, width, REACH * tolerance, tolerance)
    if fit is None:
        return replace(agreed, views=_describe_unfitted(known), disagree=True)
    fit = _hold_doubtful(fit, np.where(many, known, 0.0), least)
    moved = np.einsum("nij,nj->ni", fit.moves[view, :3, :3], points) + fit.moves[view, :3, 3]
    after = np.nan_to_num(_compare(skin, moved, view, count, gap, tolerance, even))
    healed = float(after.max()) < max(HEALED * float(known.max()), least) and fit.kept > KEPT
    healed &= _measure_far(fit, fit.common, None) < COMMON * float(known.max())
    views = []
    for number in range(count):
        beyond = fit.twists[number] - fit.common
        far = _measure_far(fit, beyond, number)
        elsewhere = bool(healed and known[number] > least and many[number] and far > APART / 2 * tolerance)
        turn = float(np.degrees(np.linalg.norm(beyond[:3]) / frame.half))
        views.append(
            ViewFit(
                number, beyond[3:], turn, float(known[number]), float(after[number]),
                bool(many[number] and fit.held[number] < HELD), round(fit.held[number]), elsewhere and is_correcting,
                elsewhere,
            )
        )  # fmt: skip
    hidden = sum(_measure_hidden(fit, view.number, gap, tolerance) for view in views if view.is_corrected)
    common = make_motion(fit.common, frame) if healed else np.eye(4)
    return ViewFits(tuple(views), fit.moves, True, common, label, found_by, hidden, fit.free, frame)


def _describe_unfitted(apart: Floats) -> tuple[ViewFit, ...]:
    """Views that differ, and that show too little skin to be fitted."""
    return tuple(ViewFit(k, np.zeros(3), 0.0, float(a), float(a), False, 6, False) for k, a in enumerate(apart))


def _hold_doubtful(fit: JointFit, apart: Floats, least: float) -> JointFit:
    """The fit without motions that wear explains as well. A view that lies with the others where they overlap, not
    ``apart`` (V,) by ``least``, is not moved against them; and one that only the part shows to be off by far more than
    it lies apart is moved as the overlap shows: its skin may be worn."""
    twists = fit.twists.copy()
    for number in range(len(twists)):
        if apart[number] <= least or _measure_far(fit, fit.shown[number] - fit.common, number) < least / 2:
            twists[number] = fit.common
        elif _measure_far(fit, fit.twists[number] - fit.shown[number], number) > EXPLAINED * apart[number]:
            twists[number] = fit.shown[number]
    return replace(fit, twists=twists)


def _measure_far(fit: JointFit, beyond: Floats, number: int | None) -> float:
    """How far a motion (6,) moves the skin of a view, or of all, along its normal, in nine tenths of it."""
    own = fit.pairs if number is None else fit.pairs.take(fit.pairs.view == number)
    return float(np.quantile(np.abs(own.jacobian @ beyond), 0.9)) if len(own.view) else 0.0


def _measure_hidden(fit: JointFit, number: int, gap: float, tolerance: float) -> float:
    """Volume that would be lost if a view were moved only as its overlap with others shows: where no other view sees
    the skin, and only the part says that it lies too deep."""
    own = fit.pairs.take((fit.pairs.view == number) & ~fit.pairs.is_shared)
    outward = own.jacobian @ (fit.twists[number] - fit.shown[number])
    return float((outward * own.count)[outward > AMBIGUOUS * tolerance].sum() * gap**2)


def _draw(aligned: Scan, label: Ints, number: int, gap: float) -> Ints:
    """Points of one view, spread evenly over what it shows."""
    own = np.flatnonzero(label == number)
    return own[pick_one_per_cube(aligned.points[own], gap)] if len(own) else own


def _compare(skin: Skin, points: Floats, view: Ints, count: int, gap: float, tolerance: float, even: float) -> Floats:
    """How far each view (V,) lies from the others where they overlap, in a fifth of it; NaN where it does not. Cells
    where the points of a view scatter by more than ``even`` show no skin of it: they are mixed ones at edges."""
    distance, places, normals = skin.find_feet(points)
    offset = np.einsum("ij,ij->i", normals, points - places)
    used = (distance < REACH * tolerance) & (np.abs(np.abs(offset) - distance) < 0.1 * tolerance)
    cells = Patches.on_skin(places[used], normals[used], 5 * gap)
    total, sums, squares = (
        cells.tabulate(view[used], count, values) for values in (None, offset[used], offset[used] ** 2)
    )
    mean = sums / np.maximum(total, 1)
    scatter = np.sqrt(np.maximum(squares / np.maximum(total, 1) - mean**2, 0))
    mean[(total < FEWEST_OF_VIEW) | (scatter > even)] = np.nan
    apart = np.full(count, np.nan)
    for number in range(count):
        others = np.delete(mean, number, axis=1)
        shared = np.isfinite(mean[:, number]) & np.isfinite(others).any(axis=1)
        if shared.sum() >= FEWEST_SHARED:
            difference = np.abs(mean[shared, number] - np.nanmedian(others[shared], axis=1))
            apart[number] = float(np.quantile(difference, 0.8))
    return apart
