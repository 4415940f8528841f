"""What is measured on circles: of shafts, rings and bores."""

from __future__ import annotations

import numpy as np

from damageest.artefacts.sections import SectionContour, SectionValue
from damageest.sections.circle import Circle, find_round, fit_circle
from damageest.sections.cut import FORM_WAVE, Cut, sum_errors
from damageest.sections.outlines import Loop, fit_stations

GROOVE = 6.0
"""Distance from the circle, in robust standard deviations of the stations, from which a part of the outline is a groove
or a burr: the circle leaves it out. What is nearer is form, and counts."""
HIDDEN = 2.5
"""Mean form of the arc that the scan does not show, in standard deviations of the form that it shows."""
LEAST_SQUARES = "of the least-squares circle (GG of ISO 14405-1)"
MOST_BORES = 4
"""Circles inside the outer one whose values are listed; of the others the deviation is."""
UPR = 15.0
"""Undulations per turn up to which roundness and run-out are measured, one of the limits of ISO
12181; with more, the noise of a scan would count."""
PASSED = 0.6
"""Width of the window of a station, in undulations, that lets half of those pass."""
NARROW = np.radians(90.0)
"""Angle that the scan has to show of a circle for its diameter."""


def measure_as_round(cut: Cut) -> tuple[tuple[SectionValue, ...], tuple[str, ...]]:
    """The quantities of each circle among the outlines, and notes."""
    values: list[SectionValue] = []
    notes: list[str] = []
    bores = 0
    for number, (outline, loop, contour) in enumerate(zip(cut.outlines, cut.loops, cut.contours, strict=True)):
        circle = find_round(outline, cut.deviation)
        if circle is None:
            continue
        is_bore = _area(outline) < 0
        bores += is_bore
        if bores > MOST_BORES:
            notes.append(f"more than {MOST_BORES} bores: those with the shortest outlines have no values")
            break
        prefix = "" if number == 0 else f"bore {bores} " if is_bore else f"outline {number + 1} "
        found, more = _measure_circle(cut, circle, loop, contour, number, prefix)
        values += found
        notes += more
    return tuple(values), tuple(notes)


def _area(outline: np.ndarray) -> float:
    x, y = outline.T
    return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _measure_circle(
    cut: Cut, nominal: Circle, loop: Loop, contour: SectionContour, number: int, prefix: str
) -> tuple[list[SectionValue], list[str]]:
    names = [prefix + name for name in ("diameter", "off centre", "run-out", "roundness")]
    limit = 1e-3 * nominal.radius + 2 * cut.deviation
    facets = 1.001 * nominal.radius * (1 - np.cos(np.pi / max(len(cut.outlines[number]), 8)))
    on_circle = np.abs(nominal.measure(loop.places)) <= limit + facets
    known = np.isfinite(contour.distance) & on_circle
    places = contour.measured[known]
    shown = float(known.sum() / max(len(known), 1)) * 2 * np.pi
    if shown < NARROW:
        why = "no scan points here" if not known.any() else f"the scan shows {np.degrees(shown):.0f} degrees of it"
        nothing = [2 * nominal.radius, 0.0, 0.0, 0.0]
        return [SectionValue(name, value, None, note=why) for name, value in zip(names, nothing, strict=True)], []
    seen = "" if shown > 6.1 else f"from the {np.degrees(shown):.0f} degrees that the scan shows"
    meant = f"{LEAST_SQUARES}, {seen}" if seen else LEAST_SQUARES
    error = sum_errors(contour.error[known], 0.0)
    circle, form = _fit_without_grooves(places, max(float(np.median(error)), 0.1 * cut.noise, 1e-9))
    # one station is as good as its points; neighbouring ones share them, and errors of the sensor
    apart = float(np.median(np.diff(loop.lengths)))
    shared = max(2 * cut.half / apart, 1.0)
    variance = float(np.median(error)) ** 2 * shared + cut.correlated**2 * max(cut.alike / apart, 1.0)
    # form that the scan does not show: in pieces as long as a wave of it, and as one; facets, not the round surface
    unseen = max(1.0 - shown / (2 * np.pi), 0.0)
    variance += form**2 * unseen * max(FORM_WAVE * loop.length / apart, 1.0)
    sagitta = _measure_sagitta(cut.outlines[number], nominal)
    spread = circle.covariance * variance
    spread[2, 2] += sagitta**2 / 3 + (HIDDEN * unseen * form) ** 2
    off = circle.centre - nominal.centre
    distance = float(np.linalg.norm(off))
    way = off / distance if distance > 0 else np.array([1.0, 0.0])
    centre_error = float(np.hypot(np.sqrt(way @ spread[:2, :2] @ way), cut.pose_shift(nominal.centre, way)))
    half = max(PASSED / 2 * 2 * np.pi * nominal.radius / UPR, cut.half)
    station = np.searchsorted(loop.lengths[:-1], cut.flat.at, side="right") - 1
    own = cut.flat.loop == number
    own[own] = on_circle[station[own]] & on_circle[(station[own] + 1) % len(on_circle)]
    waves = [_smooth(cut, loop, own, around, half) for around in (nominal, circle)]
    values = [
        SectionValue(names[0], 2 * nominal.radius, 2 * circle.radius, 2 * float(np.sqrt(spread[2, 2])), note=meant),
        SectionValue(names[1], 0.0, distance, centre_error, note=seen),
    ]
    for name, (wave, errors), extra in zip(names[2:], waves, (2 * centre_error, 0.0), strict=True):
        there = cut.reliable(np.where(on_circle, wave, np.nan), errors)
        if not there.any():
            values.append(SectionValue(name, 0.0, None, note="too few scan points here"))
            continue
        ends = np.flatnonzero(there)[[int(wave[there].argmin()), int(wave[there].argmax())]]
        both = float(np.linalg.norm(sum_errors(errors[ends], cut.correlated)))
        values.append(SectionValue(name, 0.0, float(np.ptp(wave[there])), float(np.hypot(both, extra)), note=seen))
    notes = (
        []
        if on_circle.all()
        else [f"{prefix or 'outer outline '}is a circle except for a piece that is left out, for example a groove"]
    )
    return values, notes


def _fit_without_grooves(places: np.ndarray, least: float) -> tuple[Circle, float]:
    """The least-squares circle through stations (K,2) that are no grooves, and the standard deviation of these about
    it. ``least``: standard error of a station."""
    start = fit_circle(places)
    assert start is not None
    left = start.measure(places)
    middle = max(1.4826 * float(np.median(np.abs(left - np.median(left)))), least)
    robust = fit_circle(places, 2 * middle)
    assert robust is not None
    left = np.abs(robust.measure(places))
    limit = GROOVE * max(1.4826 * float(np.median(left)), least)
    circle = fit_circle(places[left <= limit])
    if circle is None:
        circle, limit = start, float("inf")
    off = circle.measure(places[left <= limit])
    return circle, float(np.sqrt(max(float((off**2).mean()) - least**2, 0.0)))


def _measure_sagitta(outline: np.ndarray, nominal: Circle) -> float:
    """How far the facets of an outline lie inside its circle, usually."""
    edges = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    half = np.minimum(float((edges**2).sum() / max(edges.sum(), 1e-300)) / 2, nominal.radius)
    return float(nominal.radius - np.sqrt(nominal.radius**2 - half**2))


def _smooth(cut: Cut, loop: Loop, own: np.ndarray, around: Circle, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances (K,) of the scan outside a circle at the stations of an outline, and their errors."""
    at, order = cut.flat.at[own], np.argsort(cut.flat.at[own], kind="stable")
    value = around.measure(cut.flat.points[own])
    turns = (-loop.length, 0.0, loop.length)
    places = np.concatenate([at[order] + turn for turn in turns])
    wave, error, _ = fit_stations(places, np.tile(value[order], 3), loop.lengths[:-1], half)
    return wave, error
