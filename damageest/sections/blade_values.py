"""What is measured on an aerofoil.

Twist, bow and lean are the motion of the outline that fits the scan best, wear left aside: so they are known where an
edge is missing. Chord, edges and thickness are those of the outline as scanned: they are not given where the scan does
not show them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.artefacts.sections import SectionContour, SectionValue
from damageest.sections.blade import ALIKE, BladeShape, measure_blade
from damageest.sections.cut import Cut, sum_errors
from damageest.sections.fit import PlaneMotion, fit_motion
from damageest.sections.outlines import compare, measure_offsets

CLOSED = 2.5
"""Distance between two places on metal of the scan, in spacings, up to which no edge can be between them."""
TOUCHES = 1.5
"""Distance of an edge, in spacings, from places on both sides of it that the scan shows, up to which it is shown."""
BETWEEN = 0.25
"""Standard uncertainty of an edge between two such places, as a share of the distance to them."""
Marks = tuple[tuple[str, float, float], ...]


def measure_as_blade(cut: Cut) -> tuple[tuple[SectionValue, ...], Marks, tuple[str, ...]]:
    """The quantities of an aerofoil, places to draw, and notes."""
    lead = cut.find_leading()
    nominal = measure_blade(cut.outlines[0], lead)
    assert nominal is not None
    notes = []
    if lead is None and nominal.bluntness < ALIKE:
        notes.append("both edges are about as blunt: give  leading  if the leading edge is at the other end")
    own = cut.flat.loop == 0
    along = (nominal.trailing - nominal.leading) / nominal.chord
    motion = fit_motion(cut.flat, cut.loops, cut.noise, along, cut.tolerance) if own.any() else None
    marks: Marks = (_mark("leading nominal", nominal.leading), _mark("trailing nominal", nominal.trailing))
    if motion is None:
        why = "too few scan points here" if cut.seen < 0.5 else "the scan does not fix the outline"
        return (*_list_unknown(nominal, why), *_list_no_motion(nominal, why)), marks, tuple(notes)
    back = motion.undo(cut.flat.points)
    found = measure_offsets(back, cut.loops)
    own = found.loop == 0
    fitted = compare(cut.loops[0], found.at[own], found.distance[own], cut.half)
    turn = _list_motion(cut, nominal, motion, fitted)
    outline = close_outline(cut, fitted, back[own & (found.distance < -cut.tolerance)])
    shape = measure_blade(outline.places, nominal.leading - nominal.trailing)
    if shape is None:
        why = "the outline as scanned has no camber line"
        return (*_list_unknown(nominal, why), *turn), marks, tuple(notes)
    edges = {
        "leading": _edge_error(cut, fitted, outline, shape.leading),
        "trailing": _edge_error(cut, fitted, outline, shape.trailing),
    }
    for name, place in (("leading", shape.leading), ("trailing", shape.trailing)):
        if edges[name] is not None:
            marks = (*marks, _mark(f"{name} measured", motion.move(place[None])[0]))
    values = (*_list_shape(cut, fitted, nominal, shape, edges, outline), *turn)
    return values, marks, tuple(notes)


@dataclass(frozen=True, eq=False)
class Closed:
    """An outline as scanned: ``places`` (K,2), and whether each is ``shown`` (K,) by the scan, by the points of a
    ``broken`` (K,) edge; or else as designed."""

    places: Floats
    shown: Flags
    broken: Flags


def close_outline(cut: Cut, fitted: SectionContour, lost: Floats) -> Closed:
    """The outline as scanned, moved back onto that as designed.

    Where the scan has no points, the outline as designed fills the gap. Where the points ``lost`` (N,2), below the
    outline, lead across a gap, as those of a broken edge do, it is closed by them.
    """
    loop, known = cut.loops[0], np.isfinite(fitted.distance)
    places = np.where(known[:, None], fitted.measured, fitted.nominal)
    seen = np.flatnonzero(known)
    if len(seen) < 3:
        return Closed(places, known, np.zeros(len(known), bool))
    limit = CLOSED * cut.spacing
    pieces: list[tuple[Floats, bool, bool]] = []
    for first, second in zip(seen, np.roll(seen, -1), strict=True):
        pieces.append((places[first : first + 1], True, False))
        between = (first + 1 + np.arange((second - first - 1) % len(known))) % len(known)
        skipped = (loop.lengths[second] - loop.lengths[first]) % loop.length
        gap = float(np.linalg.norm(places[second] - places[first]))
        if not len(between):
            continue
        bridge = _find_bridge(places[first], places[second], lost, limit) if skipped > 1.05 * gap else None
        pieces.append((places[between], False, False) if bridge is None else (bridge, True, True))
    counts = [len(piece) for piece, _, _ in pieces]
    shown, broken = (np.repeat([piece[k] for piece in pieces], counts) for k in (1, 2))
    return Closed(np.concatenate([piece for piece, _, _ in pieces]), shown, broken)


def _find_bridge(start: Floats, end: Floats, lost: Floats, limit: float) -> Floats | None:
    """Places (K,2) of the points that lead from a place to another in steps of at most ``limit``, each the mean of
    three; None where they do not."""
    length = float(np.linalg.norm(end - start))
    if len(lost) < 3 or not length > 0:
        return None
    way = (end - start) / length
    off = lost - start
    at, beside = off @ way, np.abs(off @ np.array([-way[1], way[0]]))
    near = np.flatnonzero((at > 0) & (at < length) & (beside < max(length, limit)))
    near = near[np.argsort(at[near], kind="stable")]
    steps = np.diff(np.concatenate([[0.0], at[near], [length]]))
    if len(near) < 3 or steps.max() > limit:
        return None
    chain = lost[near]
    return np.asarray((chain[:-2] + chain[1:-1] + chain[2:]) / 3)


def _edge_error(cut: Cut, fitted: SectionContour, outline: Closed, edge: Floats) -> float | None:
    """Standard uncertainty of an edge along the chord; None where the scan does not show it."""
    near = int(np.linalg.norm(outline.places - edge, axis=1).argmin())
    seen = np.flatnonzero(outline.shown)
    sides = [seen[np.searchsorted(seen, near) % len(seen)], seen[np.searchsorted(seen, near, side="right") - 1]]
    beside = max(float(np.linalg.norm(outline.places[side] - edge)) for side in sides)
    if beside > TOUCHES * cut.spacing:
        return None
    known = np.flatnonzero(np.isfinite(fitted.distance))
    station = known[int(np.linalg.norm(fitted.measured[known] - edge, axis=1).argmin())]
    own = float(sum_errors(fitted.error[station : station + 1], cut.correlated)[0])
    # a face that the outline as designed does not have is known to within its points
    is_new = outline.broken[sides].any() or float(fitted.distance[station]) < -cut.tolerance
    unsure = BETWEEN * (cut.spacing if is_new else 0.0 if outline.shown[near] else beside)
    return float(np.hypot(own, unsure))


def _list_shape(
    cut: Cut, fitted: SectionContour, nominal: BladeShape, shape: BladeShape, edges: dict[str, float | None],
    outline: Closed,
) -> tuple[SectionValue, ...]:  # fmt: skip
    values = []
    missing = [name for name, error in edges.items() if error is None]
    if missing:
        why = f"the scan does not show the {' and the '.join(missing)} edge"
        values.append(SectionValue("chord", nominal.chord, None, note=why))
    else:
        error = float(np.hypot(edges["leading"] or 0.0, edges["trailing"] or 0.0))
        values.append(SectionValue("chord", nominal.chord, shape.chord, error))
    outward = (nominal.leading - nominal.trailing) / nominal.chord
    pairs = (("leading", shape.leading - nominal.leading, 1.0), ("trailing", shape.trailing - nominal.trailing, -1.0))
    for name, off, sign in pairs:
        edge = edges[name]
        if edge is None:
            values.append(SectionValue(f"{name} edge", 0.0, None, note=f"the scan does not show the {name} edge"))
        else:
            values.append(SectionValue(f"{name} edge", 0.0, sign * float(off @ outward), edge))
    touching = np.linalg.norm(outline.places - shape.middle, axis=1)
    contact = touching <= shape.thickness / 2 + 0.02 * shape.thickness
    if outline.shown[contact].mean() < 0.7:
        values.append(SectionValue("thickness", nominal.thickness, None, note="not scanned where it is thickest"))
    else:
        known = np.isfinite(fitted.distance)
        error = float(np.median(sum_errors(fitted.error[known], cut.correlated)) * np.sqrt(2))
        values.append(SectionValue("thickness", nominal.thickness, shape.thickness, error))
    return tuple(values)


def _list_unknown(nominal: BladeShape, why: str) -> tuple[SectionValue, ...]:
    return (
        SectionValue("chord", nominal.chord, None, note=why),
        SectionValue("leading edge", 0.0, None, note=why),
        SectionValue("trailing edge", 0.0, None, note=why),
        SectionValue("thickness", nominal.thickness, None, note=why),
    )


def _list_no_motion(nominal: BladeShape, why: str) -> tuple[SectionValue, ...]:
    return (
        SectionValue("twist", float(np.degrees(nominal.angle)), None, unit="degrees", note=why),
        *(SectionValue(name, 0.0, None, note=why) for name in ("bow", "lean", "form")),
    )


def _list_motion(
    cut: Cut, nominal: BladeShape, motion: PlaneMotion, fitted: SectionContour
) -> tuple[SectionValue, ...]:
    """Twist, bow, lean, and the form that is left."""
    angle = float(np.degrees(nominal.angle))
    middle = (nominal.leading + nominal.trailing) / 2
    along = (nominal.trailing - nominal.leading) / nominal.chord
    across = np.array([-along[1], along[0]])
    off = motion.move(middle[None])[0] - middle
    left, known = fitted.distance, cut.reliable(fitted.distance, fitted.error)
    shape = np.clip(left[known], -cut.tolerance, cut.tolerance)
    wave = np.sqrt(max(float((shape**2).mean() - np.median(fitted.error[known]) ** 2), 0.0)) if known.any() else 0.0
    covariance = motion.covariance * cut.inflate(motion.left, float(wave))
    arm = middle - motion.centre
    lever = np.array([-arm[1], arm[0]])  # how the middle moves with the angle

    def error_along(way: Floats) -> float:
        row = np.array([*way, way @ lever])
        return float(np.hypot(np.sqrt(row @ covariance @ row), cut.pose_shift(middle, way)))

    turned = float(np.hypot(np.sqrt(covariance[2, 2]), cut.pose_turn()))
    form = SectionValue("form", 0.0, None, note="no scan points here")
    if known.any():
        at = np.flatnonzero(known)
        ends = at[[int(left[known].argmin()), int(left[known].argmax())]]
        error = float(np.linalg.norm(sum_errors(fitted.error[ends], cut.correlated)))
        form = SectionValue("form", 0.0, float(np.ptp(left[known])), error)
    return (
        SectionValue("twist", angle, angle + float(np.degrees(motion.angle)), float(np.degrees(turned)), "degrees"),
        SectionValue("bow", 0.0, float(off @ across), error_along(across)),
        SectionValue("lean", 0.0, float(off @ along), error_along(along)),
        form,
    )


def _mark(name: str, place: Floats) -> tuple[str, float, float]:
    return name, float(place[0]), float(place[1])
