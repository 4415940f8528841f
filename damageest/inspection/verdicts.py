"""Whether a repaired site is within the tolerance, place by place, and the part as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.inspection.discrepancies import ELSEWHERE, Finding
from damageest.inspection.places import Landed, Places

SHOWN = 0.98
"""Share of a repaired site's skin that the scan has to show for its tolerance to be met."""
GROUP = 5
"""Neighbouring points whose median is compared with the tolerance: three of them that deviate alike decide."""
SPOT = 1.25
"""Width of a spot without points, in widths of the least defect, from which the scan does not show the site: less is
chance where points lie as far apart as they may."""
ENOUGH = 3
"""Points that a defect needs to be found, and a place for its mean."""
SURE = 2.0
"""Standard deviations of noise, of a single point, that a group of points deviates beyond the tolerance by."""
FINE = 20
"""Points nearer to each other than this share of the least defect count once."""
Outcome = Literal["met", "not met", "not shown"]


@dataclass(frozen=True)
class Verdict:
    """Whether a repaired site is within the tolerance, and why not. ``seen``: share of its skin where the scan shows
    the least defect that matters. ``lowest`` and ``highest``: deviation of the places that deviate most; None where
    the scan shows none. ``shows``: width of the smallest defect that the scan shows wherever it lies on this site;
    None where it has too few points for any."""

    site: int
    outcome: Outcome
    why: str
    seen: float
    lowest: float | None
    highest: float | None
    shows: float | None


@dataclass(frozen=True)
class WholeVerdict:
    """Whether the part is within the tolerance as a whole, as far as the scan shows it."""

    outcome: Outcome
    why: str


def judge_site(
    number: int, places: Places | None, landed: Landed | None, findings: Sequence[Finding], tolerance: float,
    noise: float, unit: str,
) -> Verdict:  # fmt: skip
    """Judges a site by every point that lies on it. ``findings``: all of the part."""
    wrong = [f"{one.kind} {one.volume:.4g} {unit}³{_describe_more(one)}" for one in findings if number in one.sites]
    if places is None or landed is None:
        return Verdict(number, "not met" if wrong else "not shown", ", ".join(wrong) or "no skin of its own",
                       0.0, None, None, None)  # fmt: skip
    seen, shows, gap = _measure_seen(places, landed)
    groups = _measure_groups(places, landed)
    off = _find_off(groups, tolerance, noise)
    means = _measure_places(places, landed)
    known = np.concatenate([means[np.isfinite(means)], groups[off]])
    lowest, highest = (float(known.min()), float(known.max())) if len(known) else (None, None)
    if not wrong:
        if lowest is not None and lowest < -tolerance:
            wrong.append(f"too low by up to {-lowest:.3g} {unit}")
        if highest is not None and highest > tolerance:
            wrong.append(f"too high by up to {highest:.3g} {unit}")
    if wrong:
        return Verdict(number, "not met", ", ".join(wrong), seen, lowest, highest, shows)
    if seen < SHOWN or gap > SPOT * places.defect:
        what = f"the scan shows a defect of {places.defect:.3g} {unit} on {100 * seen:.0f} % of it"
        if gap > SPOT * places.defect:
            what += f", and a spot {gap:.3g} {unit} wide has no points"
        return Verdict(number, "not shown", what, seen, lowest, highest, shows)
    return Verdict(number, "met", "", seen, lowest, highest, shows)


def judge_whole(
    verdicts: Sequence[Verdict], findings: Sequence[Finding], elsewhere: Literal["decides", "listed"], unit: str
) -> WholeVerdict:
    """Judges the part by its sites, and by what was found elsewhere where that ``decides``."""
    bad = [f"site {one.site}" for one in verdicts if one.outcome == "not met"]
    if elsewhere == "decides":
        bad += [f"{one.kind} {one.volume:.4g} {unit}³ elsewhere" for one in findings if ELSEWHERE in one.sites]
    if bad:
        return WholeVerdict("not met", ", ".join(bad))
    hidden = [f"site {one.site}" for one in verdicts if one.outcome == "not shown"]
    return WholeVerdict("not shown", ", ".join(hidden)) if hidden else WholeVerdict("met", "")


def _describe_more(one: Finding) -> str:
    """Where else a finding lies."""
    others = len(one.sites) > 1
    return " (also on other sites or elsewhere)" if others else ""


def _measure_seen(places: Places, landed: Landed) -> tuple[float, float | None, float]:
    """Share of the skin where a disc as wide as the least defect has `ENOUGH` points; width of the smallest disc that
    has them anywhere; width of the largest disc without points."""
    skin = places.embed(places.skin.at, places.skin.normals)
    if not len(landed.feet):
        return 0.0, None, float("inf")
    feet = landed.feet[pick_one_per_cube(landed.feet[:, :3], places.defect / FINE)]
    if len(feet) < ENOUGH:
        return 0.0, None, float("inf")
    gap = find_neighbours(skin, ENOUGH, feet)[0]
    seen = float((2 * gap[:, -1] <= places.defect).mean())
    return seen, 2 * float(gap[:, -1].max()), 2 * float(gap[:, 0].max())


def _measure_groups(places: Places, landed: Landed) -> Floats:
    """(N,) for each point the median distance of it and its nearest neighbours on the skin."""
    if len(landed.feet) < GROUP:
        return landed.distance
    index = find_neighbours(landed.feet, GROUP)[1]
    return np.asarray(np.median(landed.distance[index], axis=1))


def _find_off(groups: Floats, tolerance: float, noise: float) -> Flags:
    """Which groups of points (N,) deviate beyond the tolerance by more than noise."""
    return np.asarray(np.abs(groups) > tolerance + SURE * noise)


def _measure_places(places: Places, landed: Landed) -> Floats:
    """(P,) the median distance at each place; NaN where it has too few points."""
    order = np.lexsort((landed.distance, landed.place))
    counts = np.bincount(landed.place, minlength=places.count)
    ends = np.cumsum(counts)
    starts = ends - counts
    out = np.full(places.count, np.nan)
    full = np.flatnonzero(counts >= ENOUGH)
    value = landed.distance[order]
    low, high = starts[full] + (counts[full] - 1) // 2, starts[full] + counts[full] // 2
    out[full] = (value[low] + value[high]) / 2
    return out
