"""Sections as tables (CSV) and drawings (SVG)."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.artefacts.sections import Section, SectionContour

FOLDER = "sections"
WIDTH, MARGIN, LOWEST, HIGHEST = 640.0, 26.0, 150.0, 420.0
"""Size of a drawing and its margin; least and largest height."""
SHOWN = 0.07
"""Length at which the largest deviation is drawn, as a share of the section's longest side."""
COLOURS = {"ink": "#1b2733", "soft": "#7b8794", "metal": "#e3e7ea", "below": "#3366cc", "above": "#cc3333",
           "within": "#2e8b57", "unseen": "#c77f00"}  # fmt: skip
"""Colours of a drawing that stands alone."""


def write_section_files(folder: Path, sections: Sequence[Section], tolerance: float, unit: str) -> tuple[str, ...]:
    """Writes a table of all values, and for each section its stations and its drawing, below ``folder``; gives their
    paths, relative to it."""
    if not sections:
        return ()
    place = folder / FOLDER
    place.mkdir(parents=True, exist_ok=True)
    named = {"sections.csv": describe_values(sections, unit)}
    for section in sections:
        if section.contours:
            named[f"section-{section.number}.csv"] = describe_stations(section, unit)
            named[f"section-{section.number}.svg"] = draw_section(section, tolerance, unit)
    for name, text in named.items():
        (place / name).write_text(text, encoding="utf-8")
    return tuple(f"{FOLDER}/{name}" for name in named)


def describe_values(sections: Sequence[Section], unit: str) -> str:
    """The values of all sections as CSV, one in a row."""
    head = ("section", "name", "kind", "quantity", "unit", "nominal", "measured", "difference",
            "standard uncertainty", "note")  # fmt: skip
    rows = [
        (section.number, section.name, section.kind, value.name, unit if value.unit == "length" else value.unit,
         _show(value.nominal), _show(value.measured), _show(value.difference),
         _show(value.error if value.measured is not None else None), value.note)
        for section in sections for value in section.values
    ]  # fmt: skip
    empty = [
        (one.number, one.name, one.kind, "", "", "", "", "", "", "; ".join(one.notes))
        for one in sections if not one.values
    ]  # fmt: skip
    return _to_csv(head, [*rows, *empty])


def describe_stations(section: Section, unit: str) -> str:
    """The stations of a section as CSV: their positions, and the deviation of the scan from the part as designed."""
    head = ("outline", f"along, {unit}", f"x, {unit}", f"y, {unit}", f"z, {unit}", f"deviation, {unit}",
            f"standard uncertainty, {unit}", "points")  # fmt: skip
    rows = []
    for number, contour in enumerate(section.contours, 1):
        places = section.to_part(contour.nominal)
        for k, along in enumerate(contour.lengths):
            known = math.isfinite(contour.distance[k])
            values = (float(contour.distance[k]), float(contour.error[k])) if known else (None, None)
            at = (along, *places[k])
            rows.append((number, *map(_show, map(float, at)), *map(_show, values), int(contour.counts[k])))
    return _to_csv(head, rows)


def _show(value: float | None) -> str:
    return "" if value is None else f"{value + 0.0:.6g}"


def _to_csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return stream.getvalue()


@dataclass(frozen=True)
class Drawing:
    """Lines and areas of a section on paper, y downward: ``size`` (2,) of it; ``times``: exaggeration of deviations;
    ``areas``: closed outlines as designed; ``lines``: by their meaning, a key of `COLOURS`; ``marks``: places by name;
    ``ruler``: its ends and its length as text."""

    size: tuple[float, float]
    times: float
    areas: tuple[Floats, ...]
    outlines: tuple[Floats, ...]
    limits: tuple[Floats, ...]
    lines: tuple[tuple[str, Floats], ...]
    marks: tuple[tuple[str, float, float], ...]
    ruler: tuple[Floats, str]


def lay_out(section: Section, tolerance: float, unit: str, width: float = WIDTH) -> Drawing:
    """A section laid out on paper of a ``width``."""
    flat = np.concatenate([contour.nominal for contour in section.contours])
    size = float(np.ptp(flat, axis=0).max())
    deviations = np.concatenate([contour.distance for contour in section.contours])
    largest = max(float(np.abs(deviations[np.isfinite(deviations)]).max(initial=0.0)), tolerance)
    times = max(round_nice(SHOWN * size / largest), 1.0) if largest > 0 else 1.0
    moved = np.concatenate([_exaggerate(contour, times) for contour in section.contours])
    everything = np.concatenate([flat, moved[np.isfinite(moved).all(axis=1)]])
    low, high = everything.min(axis=0), everything.max(axis=0)
    low, high = low - 0.02 * size, high + 0.02 * size
    scale = min((width - 2 * MARGIN) / (high[0] - low[0]), (HIGHEST - 2 * MARGIN) / (high[1] - low[1]))
    height = max(scale * (high[1] - low[1]) + 2 * MARGIN, LOWEST)
    middle = (low + high) / 2

    def place(points: Floats) -> Floats:
        return np.asarray(np.array([width / 2, height / 2 - 6]) + scale * (points - middle) * np.array([1.0, -1.0]))

    closed = section.kind != "line"
    outlines = [np.vstack([c.nominal, c.nominal[:1]]) if closed else c.nominal for c in section.contours]
    lines = [
        (kind, place(line)) for contour in section.contours for kind, line in _part(contour, tolerance, times, closed)
    ]
    limits = [
        place(np.vstack([edge, edge[:1]]) if closed else edge)
        for c in section.contours for edge in (c.nominal + sign * times * tolerance * c.normals for sign in (-1, 1))
    ]  # fmt: skip
    length = round_nice(0.25 * (width - 2 * MARGIN) / scale)
    start = np.array([MARGIN, height - 12.0])
    marks = [(name, *place(np.array([[x, y]]))[0].tolist()) for name, x, y in section.marks]
    return Drawing(
        (width, height),
        times,
        tuple(place(each) for each in outlines) if closed else (),
        tuple(place(each) for each in outlines),
        tuple(limits),
        tuple(lines),
        tuple(marks),
        (start + np.array([[0.0, 0.0], [length * scale, 0.0]]), f"{length:g} {unit}"),
    )


def draw_section(section: Section, tolerance: float, unit: str, colours: Mapping[str, str] = COLOURS) -> str:
    """A section as SVG: the outline as designed, and the scan with its deviations drawn larger."""
    paper = lay_out(section, tolerance, unit)
    width, height = paper.size
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:.0f}" font-family="sans-serif" '
        'font-size="11">'
    ]
    if paper.areas:
        areas = " ".join(_to_path(each, "Z") for each in paper.areas)
        parts.append(f'<path class="metal" d="{areas}" style="fill:{colours["metal"]};fill-rule:evenodd"/>')
    parts += [_draw(each, "nominal", colours["ink"], 0.8) for each in paper.outlines]
    parts += [_draw(each, "limit", colours["soft"], 0.6, "4 3") for each in paper.limits]
    for kind, line in paper.lines:
        parts.append(_draw(line, kind, colours[kind], 1.8, "1.5 3" if kind == "unseen" else ""))
    parts += [_draw_mark(mark, colours) for mark in paper.marks]
    ruler, text = paper.ruler
    parts.append(_draw(ruler, "ruler", colours["ink"], 1.4))
    x, y = ruler[1]
    legend = f"{text}; deviations x {paper.times:g}; dashed: tolerance {tolerance:.3g} {unit}; dotted: no scan points"
    parts.append(f'<text x="{x + 8:.1f}" y="{y + 4:.1f}" style="fill:{colours["ink"]}">{legend}</text>')
    return "\n".join([*parts, "</svg>", ""])


def _part(contour: SectionContour, tolerance: float, times: float, closed: bool) -> list[tuple[str, Floats]]:
    """The measured line in pieces of one kind each: below, within and above the tolerance; and where it is unseen."""
    turn = (lambda a: np.concatenate([a, a[:1]])) if closed else (lambda a: a)
    distance, nominal = turn(contour.distance), turn(contour.nominal)
    moved = turn(_exaggerate(contour, times))
    known = np.isfinite(distance)
    value = np.where(known, distance, 0.0)
    kinds: list[tuple[str, Flags, Floats]] = [
        ("below", known & (value < -tolerance), moved),
        ("within", known & (np.abs(value) <= tolerance), moved),
        ("above", known & (value > tolerance), moved),
        ("unseen", ~known, nominal),
    ]
    found = []
    for kind, chosen, places in kinds:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(np.int8), [0]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            # on to the next station, so that pieces meet
            end = last + 1 if last < len(places) and np.isfinite(places[last]).all() else last
            if end - first > 1:
                found.append((kind, places[first:end]))
    return found


def _exaggerate(contour: SectionContour, times: float) -> Floats:
    return np.asarray(contour.nominal + times * contour.distance[:, None] * contour.normals)


def round_nice(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is at most a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9))


def _to_path(points: Floats, end: str = "") -> str:
    return "M" + " ".join(f"{x:.2f},{y:.2f}" for x, y in points) + end


def _draw(points: Floats, name: str, colour: str, width: float, dashes: str = "") -> str:
    dashed = f";stroke-dasharray:{dashes}" if dashes else ""
    return (
        f'<path class="{name}" d="{_to_path(points)}" style="fill:none;stroke:{colour};stroke-width:{width}{dashed}"/>'
    )


def _draw_mark(mark: tuple[str, float, float], colours: Mapping[str, str]) -> str:
    name, x, y = mark
    arm, colour = (5, colours["ink"]) if name.endswith("nominal") else (4, colours["above"])
    turn = (1, 0, 0, 1) if name.endswith("nominal") else (1, 1, 1, -1)
    lines = " ".join(
        f"M{x - arm * turn[k]:.2f},{y - arm * turn[k + 1]:.2f} L{x + arm * turn[k]:.2f},{y + arm * turn[k + 1]:.2f}"
        for k in (0, 2)
    )
    style = f"fill:none;stroke:{colour};stroke-width:1.1"
    return f'<path class="mark" d="{lines}" style="{style}"><title>{name}</title></path>'
