"""The sections that a job asks for: cut, compared with the scan, and measured as what they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.artefacts.sections import Section, SectionContour, SectionValue
from damageest.job.sections import SectionChoice
from damageest.sections.blade import is_blade, measure_blade
from damageest.sections.blade_values import measure_as_blade
from damageest.sections.circle import find_round
from damageest.sections.cut import Cut, sum_errors
from damageest.sections.line import measure_line
from damageest.sections.outlines import (
    STEP,
    WINDOW,
    Loop,
    compare,
    cut_part,
    flatten_scan,
    make_loop,
)
from damageest.sections.planes import Place, list_places
from damageest.sections.round_values import measure_as_round
from damageest.trust.interval.pose_error import PoseError

REACH = 0.1
"""Largest distance of scan points outside the outlines that are compared, in the longest side of the section."""
UNSEEN = 0.02
"""Share of the outlines below which a section counts as not scanned."""


@dataclass(frozen=True, eq=False)
class Scanned:
    """What sections are compared with: ``points`` (N,3) of the scan in the frame of the part as designed, their
    ``spacing``, standard deviation ``noise``, that of errors that neighbours share (``correlated``, over ``alike``),
    and the error of the pose. ``unit``: of lengths, for words."""

    points: Floats
    spacing: float
    noise: float
    correlated: float = 0.0
    alike: float = 0.0
    pose: PoseError | None = None
    unit: str = "mm"


def measure_sections(
    choices: Sequence[SectionChoice], part: Mesh, scanned: Scanned, tolerance: float, deviation: float = 0.0
) -> tuple[Section, ...]:
    """All sections that a job asks for, in its order.

    ``part``: as designed, watertight; ``deviation``: largest distance of its triangles from the surface that they stand
    for; ``tolerance``: by which the skin counts as deviating. All lengths are in one unit.
    """
    places = list_places(choices, part)
    found = [_measure(number, place, part, scanned, tolerance, deviation) for number, place in enumerate(places, 1)]
    for group in dict.fromkeys(section.group for section in found):
        own = [k for k, section in enumerate(found) if section.group == group and section.kind == "blade"]
        for k, section in zip(own, _add_straight_bow([found[k] for k in own]), strict=True):
            found[k] = section
    return tuple(found)


def _measure(number: int, place: Place, part: Mesh, scanned: Scanned, tolerance: float, deviation: float) -> Section:
    if place.line is not None:
        return measure_line(number, place, part, scanned.points, scanned.spacing)
    empty = _make(number, place, "none")
    try:
        outlines = cut_part(part, place)
    except ValueError as error:
        return replace(empty, notes=(f"the part cannot be cut here: {error}",))
    if not outlines:
        heights = (part.vertices - place.origin) @ place.across
        gap = max(float(heights.min()), -float(heights.max()), 0.0)
        beside = f"it passes beside the part, {gap:.4g} {scanned.unit} from it; move it" if gap else "it meets no solid"
        return replace(empty, notes=(f"the plane does not cut the part: {beside}",))
    loops = [make_loop(outline, STEP * max(scanned.spacing, 1e-9)) for outline in outlines]
    longest = float(np.ptp(outlines[0], axis=0).max())
    reach = max(REACH * longest, 3 * tolerance)
    flat = flatten_scan(scanned.points, scanned.spacing, part, place, loops, reach)
    half = WINDOW * scanned.spacing
    contours = tuple(
        compare(loop, flat.at[flat.loop == k], flat.distance[flat.loop == k], half) for k, loop in enumerate(loops)
    )
    seen = _share_seen(contours, loops)
    cut = Cut(place, outlines, loops, contours, flat, scanned.spacing, tolerance, deviation, scanned.noise,
              scanned.correlated, max(scanned.alike, 2 * half), scanned.pose, seen)  # fmt: skip
    kind, notes = _choose_kind(cut)
    section = _make(number, place, kind)
    section = replace(section, contours=contours, seen=seen, slab=flat.slab, points=len(flat.points), notes=notes)
    values: tuple[SectionValue, ...] = ()
    marks: tuple[tuple[str, float, float], ...] = ()
    if kind == "blade":
        values, marks, more = measure_as_blade(cut)
        notes = (*notes, *more)
    elif kind == "round":
        values, more = measure_as_round(cut)
        notes = (*notes, *more)
    if seen < UNSEEN:
        notes = (*notes, "the scan does not show the part here")
    return replace(section, values=(*values, *_measure_deviation(cut)), marks=marks, notes=notes)


def _make(number: int, place: Place, kind: str) -> Section:
    origin, along, out, across = (
        tuple((np.round(v, 12) + 0.0).tolist()) for v in (place.origin, place.along, place.out, place.across)
    )
    return Section(number, place.name, kind, origin, along, out, across, group=place.group)


def _share_seen(contours: Sequence[SectionContour], loops: list[Loop]) -> float:
    known = total = 0.0
    for contour, loop in zip(contours, loops, strict=True):
        weight = (np.diff(loop.lengths) + np.roll(np.diff(loop.lengths), 1)) / 2
        known += float(weight[np.isfinite(contour.distance)].sum())
        total += loop.length
    return min(known / total, 1.0)


def _choose_kind(cut: Cut) -> tuple[str, tuple[str, ...]]:
    """What the section as designed is. A kind that the job names stays, with a note where it is not of that kind."""
    asked = cut.place.choice.kind
    if asked == "contour":
        return "contour", ()
    if asked in ("auto", "round") and find_round(cut.outlines[0], cut.deviation) is not None:
        return "round", ()
    if asked == "round":
        return "contour", ("its outline as designed is no circle, so there is no diameter; take kind: contour",)
    lead = cut.find_leading()
    shape = measure_blade(cut.outlines[0], lead)
    if shape is not None and (asked == "blade" or is_blade(cut.outlines[0], shape)):
        doubt = (
            ()
            if is_blade(cut.outlines[0], shape)
            else ("its outline as designed is hardly an aerofoil; take kind: contour if it is none",)
        )
        return "blade", doubt
    if asked == "blade":
        return "contour", ("its outline as designed is no aerofoil, so there is no chord; take kind: contour",)
    return "contour", ()


def _measure_deviation(cut: Cut) -> tuple[SectionValue, ...]:
    """How far the scan is from the outlines as designed, in the pose of the run."""
    distance = np.concatenate([contour.distance for contour in cut.contours])
    error = np.concatenate([contour.error for contour in cut.contours])
    known = cut.reliable(distance, error)
    if not known.any():
        why = "no scan points here"
        return tuple(SectionValue(name, None, None, note=why) for name in ("deepest", "highest", "line profile"))
    distance, error = distance[known], error[known]
    low, high = int(distance.argmin()), int(distance.argmax())
    both = sum_errors(error, cut.correlated)
    seen = "" if cut.seen > 0.95 else f"of the {100 * cut.seen:.0f} % that the scan shows"
    far = int(np.abs(distance).argmax())
    return (
        SectionValue("deepest", 0.0, float(distance[low]), float(both[low]), note=seen),
        SectionValue("highest", 0.0, float(distance[high]), float(both[high]), note=seen),
        SectionValue("line profile", 0.0, 2 * float(abs(distance[far])), 2 * float(both[far]), note=seen),
    )


def _add_straight_bow(sections: list[Section]) -> list[Section]:
    """Sections of one series with their bow from the straight line through the first and the last that have one."""
    known = [k for k, section in enumerate(sections) if section.value("bow").measured is not None]
    if len(known) < 3:
        return sections
    places = np.array([section.origin for section in sections])
    at = (places - places[0]) @ np.array(sections[0].across)
    first, last = known[0], known[-1]
    if not abs(at[last] - at[first]) > 0:
        return sections
    ends = [sections[k].value("bow") for k in (first, last)]
    done = []
    for k, section in enumerate(sections):
        bow, share = section.value("bow"), (at[k] - at[first]) / (at[last] - at[first])
        if bow.measured is None or ends[0].measured is None or ends[1].measured is None:
            value = SectionValue("bow from straight", 0.0, None, note=bow.note)
        else:
            line = (1 - share) * ends[0].measured + share * ends[1].measured
            parts = [bow.error, (1 - share) * ends[0].error, share * ends[1].error]
            error = 0.0 if k in (first, last) else float(np.linalg.norm(parts))
            value = SectionValue("bow from straight", 0.0, float(bow.measured - line), error)
        where = [each.name for each in section.values].index("bow") + 1
        done.append(replace(section, values=(*section.values[:where], value, *section.values[where:])))
    return done
