"""The surfaces that are tried as tools that cut a damage volume out of the part, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Mesh, Part
from damageest_cadquery.cutting.check_pieces import LIMITS
from damageest_cadquery.solids.split import Tool, build_flat, is_opencascade_error, is_valid
from damageest_cadquery.surfaces.flat_faces import Flat, find_flat_faces
from damageest_cadquery.surfaces.open_surface import Cut, find_inner, take_faces
from damageest_cadquery.surfaces.polyhedron import Probes, decimate, fit, mark_planes, shift_free
from damageest_cadquery.surfaces.recognised import build_shapes, find_shapes
from damageest_cadquery.surfaces.splines import SPANS, Way, build_splines, drop_tails, find_charts

PLANES = (300, 500, 800, 1200, 2000)
FACETS = (150, 200, 270, 360, 480, 640, 850, 1150, 1550, 2100, 2900, 4000)
"""Numbers of triangles that are tried; most are given up before a split, by a look at the distances."""
NARROW = 0.8
"""Share of the limit of a form within which a simplified surface must be before it is tried."""
SOME, MOSTLY = 0.25, 0.6
"""Share of the surface on planes from which these are faces of their own, and from which they come before splines."""
MOST_SPLINES = 2
"""Splines near enough that are tried, the coarsest first: each attempt takes a second or more."""


class Attempt(NamedTuple):
    """``form``: its name; ``make`` builds its tool; ``fuzzies``: the fuzzy values to try it with, in millimetres;
    ``shift`` builds the tool moved along its normals, out of the damage volume, by a length; None where it cannot be.
    """

    form: str
    make: Callable[[], Tool | None]
    fuzzies: tuple[float, ...]
    shift: Callable[[float], Tool | None] | None = None


def list_tools(cut: Cut, part: Part, tolerance: float) -> Iterator[Attempt]:
    """What is tried, the preferred first."""
    rows = find_inner(cut)
    inner = take_faces(cut.mesh, rows)
    found = find_shapes(inner, tolerance)
    if found.whole:
        for beyond in (2.0, 1.0, 4.0):
            make = partial(build_shapes, inner, found.shapes, found.nearest, tolerance, beyond * tolerance)
            yield Attempt(f"shapes {beyond:g}", make, (1e-6,))
    flat = [k for k, shape in enumerate(found.shapes) if shape.kind == "plane"]
    area = 2 * inner.face_areas
    share = area[np.isin(found.label, flat)].sum() / area.sum()
    if share < MOSTLY:
        yield from _list_splines(inner, part, tolerance)
    depth = cut.height[np.unique(cut.mesh.faces[rows])]
    deep = depth < -tolerance / 4
    probes = Probes(inner.vertices[deep], np.linalg.norm(inner.vertex_cross, axis=1)[deep])
    if share > SOME:
        planes = mark_planes(cut, rows, found.label, found.shapes, tolerance)
        yield from _list_flat(planes, cut, probes, tolerance, PLANES)
    if share >= MOSTLY:
        yield from _list_splines(inner, part, tolerance)
    yield from _list_flat(mark_planes(cut, rows, found.label, (), tolerance), cut, probes, tolerance, FACETS)


def _list_flat(flat: Flat, cut: Cut, probes: Probes, tolerance: float, counts: Sequence[int]) -> Iterator[Attempt]:
    levels = []
    for count in sorted(counts, reverse=True):  # each from the one before: the first step takes longest
        flat = decimate(flat, count)
        levels.append((count, flat))
    for count, level in reversed(levels):
        if len(level.mesh.faces) > 2 * count:
            continue
        less = fit(level, cut, tolerance)
        form = "planes" if (less.label >= 0).any() else "facets"
        if probes.measure_beyond(less, tolerance / 4) > NARROW * LIMITS[form][0]:
            continue
        tool = _build(less)
        if form == "facets" or is_valid(tool):
            yield Attempt(f"{form} {count}", partial(_give, tool), (1e-6, 1e-4), partial(_build_shifted, less))


def _build(flat: Flat) -> Tool:
    return build_flat(flat.mesh.vertices, find_flat_faces(flat))


def _build_shifted(flat: Flat, step: float) -> Tool:
    return _build(shift_free(flat, step))


def _list_splines(inner: Mesh, part: Part, tolerance: float) -> Iterator[Attempt]:
    wide, near = drop_tails(inner, 1.2 * tolerance), 0
    ways: tuple[Way, ...] = ("seen", "disk")
    for how in ways:
        charts = find_charts(wide, how, part, tolerance)
        if charts is None:
            continue
        for spans in SPANS:
            tool = call(partial(build_splines, charts, part, spans, tolerance))
            if tool is not None:
                yield Attempt(f"spline {spans}", partial(_give, tool), (1e-6,))
                near += 1
                if near == MOST_SPLINES:
                    return


def _give(tool: Tool) -> Tool:
    return tool


def call(make: Callable[[], Tool | None]) -> Tool | None:
    """A tool, or None where OpenCASCADE cannot build it."""
    try:
        return make()
    except Exception as error:
        if not is_opencascade_error(error):
            raise
        return None
