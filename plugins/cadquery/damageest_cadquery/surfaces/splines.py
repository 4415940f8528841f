"""Splines through an inner damage surface, which go on beyond its rim until they have left the part.

A spline is fitted to the surface first; its directions at the rim are averaged along it and turned away from the part's
skin where they do not leave it; then it is fitted again to the surface and to points ahead in these directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.ndimage import uniform_filter1d
from scipy.spatial import cKDTree

from damageest.artefacts import Flags, Floats, Mesh, Part
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh, signed_distance
from damageest.geometry.height_spline import DEGREE, fit_height_plane, fit_parametric_spline
from damageest.geometry.vectors import normalise
from damageest.stages.export import Patch
from damageest_cadquery.solids.split import Tool
from damageest_cadquery.surfaces._flatten import flatten
from damageest_cadquery.surfaces._outlines import cover, trace_regions, walk_outline
from damageest_cadquery.surfaces.open_surface import find_rim, split_mesh, take_faces
from damageest_cadquery.writing.patch import build_surface, build_wire

SPANS = (8, 14, 20, 28, 38, 50)
BIT = 2e-3
"""Share of the surface below which a connected piece of it gets no spline."""
HIDDEN = 0.04
"""Largest share of a surface that may face away where it is seen from one side; the fit then decides."""
EXTENTS = (1.5, 1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
"""How far a spline reaches beyond the inner damage surface, in tolerances: the first at which it has left the part."""
RISE = 0.5
"""Least slope against the part's skin with which a spline goes on beyond its rim."""
OUTSIDE = 0.7
"""Least height over the part, in tolerances, of points to which it goes on."""
EVEN = 9
"""Places along the rim, a tolerance apart, over which the direction is averaged in which a spline goes on."""
_WRAP = 2 * np.pi
Fit = tuple[tuple[Floats, Floats], Floats]
"""Knots in both directions and poles of a spline."""
Way = Literal["seen", "disk"]
"""How a surface is spread over a plane."""


@dataclass(frozen=True, eq=False)
class Chart:
    """``uv`` (V,2): places, in the plane, of the vertices of ``mesh``, about as far apart as in space; ``deep`` (V,):
    whether they lie deeper than a quarter of the tolerance below the part's skin; ``outlines`` (K,2): of all places."""

    mesh: Mesh
    uv: Floats
    deep: Flags
    outlines: Sequence[Floats]


def drop_tails(inner: Mesh, width: float) -> Mesh:
    """The surface without what is narrower than twice the ``width``: noise draws it out along the skin."""
    rim = np.unique(find_rim(inner.faces))
    points = inner.vertices
    wide = np.asarray(cKDTree(points[rim]).query(points)[0]) > width
    if not wide.any():
        return inner
    kept = np.asarray(cKDTree(points[wide]).query(points)[0]) < 1.3 * width
    return take_faces(inner, np.flatnonzero(kept[inner.faces].all(axis=1)))


def find_charts(inner: Mesh, how: Way, part: Part, tolerance: float) -> list[Chart] | None:
    """Each connected piece of a surface spread over a plane: as seen from one side, or over a disk, also where it
    overhangs. None where one cannot be."""
    charts, whole = [], 2 * inner.area
    for piece in split_mesh(_drop_pinches(inner)):
        area = 2 * piece.area
        if area < BIT * whole:
            continue
        if how == "seen":
            uv = _look_along(piece)
        else:
            disk = flatten(piece)
            uv = None if disk is None else disk * np.sqrt(area / _WRAP)
        if uv is None:
            return None
        outlines, hidden = cover(uv[piece.faces])
        if hidden > 2 * HIDDEN:
            return None
        deep = distance_to_mesh(piece.vertices, part) > tolerance / 4
        charts.append(Chart(piece, uv, deep, outlines))
    return charts


def _drop_pinches(mesh: Mesh) -> Mesh:
    """The surface without the triangles at vertices in which its rim touches itself."""
    for _ in range(6):
        starts = np.bincount(find_rim(mesh.faces)[:, 0], minlength=len(mesh.vertices))
        if not (starts > 1).any():
            break
        mesh = take_faces(mesh, np.flatnonzero(~(starts > 1)[mesh.faces].any(axis=1)))
    return mesh


def _look_along(mesh: Mesh) -> Floats | None:
    """(V,2) the vertices as seen from the side that shows most of the surface; None where it hides too much."""
    axes, away = fit_height_plane(mesh)
    return None if away > HIDDEN else (mesh.vertices - mesh.bounds.mean(axis=0)) @ axes[:2].T


def build_splines(charts: Sequence[Chart], part: Part, spans: int, tolerance: float) -> Tool | None:
    """A spline through each piece, which ends outside the part.

    None where one of them is farther from it than the checks allow, or where it does not leave the part.
    """
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    faces: list[Any] = []
    for chart in charts:
        made = _build_spline(chart, part, spans, tolerance)
        if made is None:
            return None
        faces += made
    if len(faces) == 1:
        return Tool(faces, faces[0])
    builder, shape = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(shape)
    for face in faces:
        builder.Add(shape, face)
    return Tool(faces, shape)


def _build_spline(chart: Chart, part: Part, spans: int, tolerance: float) -> list[Any] | None:
    vertices = chart.mesh.vertices
    margin = 1.1 * EXTENTS[-1] * tolerance / float(np.ptp(chart.uv, axis=0).max())
    first = fit_parametric_spline(chart.uv, vertices, spans, margin)
    if not _is_near(first, chart, tolerance) or not any(trace_regions(chart.outlines, tolerance, 0.0)):
        return None  # of a chart smaller than the steps of its outline none is left
    uv, beyond = _continue(chart, first, part, tolerance)
    fit = fit_parametric_spline(np.concatenate([chart.uv, uv]), np.concatenate([vertices, beyond]), spans, 0.02)
    if not _is_near(fit, chart, tolerance):
        return None
    best, regions = tolerance / 20, None
    for extent in EXTENTS:
        found = trace_regions(chart.outlines, extent * tolerance)
        if not any(found):
            continue
        rim = np.concatenate([walk_outline(loop, tolerance / 2)[0] for loops in found for loop in loops])
        height = float(signed_distance(_evaluate(fit, rim), part)[0].min())
        if height > best:
            best, regions = height, found
        if best > tolerance / 4:
            break
    if regions is None:
        return None
    surface = build_surface(Patch(DEGREE, *fit), 1.0)
    return [_trim(surface, loops) for loops in regions]


def _is_near(fit: Fit, chart: Chart, tolerance: float) -> bool:
    if not chart.deep.any():
        return True
    way = _evaluate(fit, chart.uv[chart.deep]) - chart.mesh.vertices[chart.deep]
    off = np.abs(np.einsum("ij,ij->i", way, chart.mesh.vertex_normals[chart.deep]))
    area = np.linalg.norm(chart.mesh.vertex_cross, axis=1)[chart.deep]
    return bool(area[off > tolerance / 4].sum() <= 0.015 * area.sum() and off.max() <= 1.5 * tolerance)


def _continue(chart: Chart, fit: Fit, part: Part, tolerance: float) -> tuple[Floats, Floats]:
    """Places (N,2) beyond the rim of a chart, and points (N,3) there: straight on, and away from the part."""
    places, points = [], []
    steps = np.arange(1.5, EXTENTS[-1] + 2.5, 1.5) * tolerance
    for loop in (loop for region in trace_regions(chart.outlines, tolerance, 0.0) for loop in region):
        at, out = walk_outline(loop, tolerance)
        inside = at - 0.7 * tolerance * out
        start, back = _evaluate(fit, inside), _evaluate(fit, inside - 1.5 * tolerance * out)
        way = uniform_filter1d((start - back) / (1.5 * tolerance), min(EVEN, len(at)), axis=0, mode="wrap")
        size = np.linalg.norm(way, axis=1, keepdims=True)
        _, face, _ = closest_on_mesh(start, part)
        skin = uniform_filter1d(part.face_normals[face], min(EVEN, len(at)), axis=0, mode="wrap")
        skin = normalise(skin)
        rise = np.einsum("ij,ij->i", way, skin)[:, None] / size
        way += np.maximum(RISE - rise, 0.0) * size * skin
        places.append((inside[:, None] + steps[:, None] * out[:, None]).reshape(-1, 2))
        points.append((start[:, None] + steps[:, None] * way[:, None]).reshape(-1, 3))
    uv, beyond = np.concatenate(places), np.concatenate(points)
    low = np.flatnonzero(signed_distance(beyond, part)[0] < OUTSIDE * tolerance)  # as behind a concave edge
    _, face, foot = closest_on_mesh(beyond[low], part)
    beyond[low] = foot + OUTSIDE * tolerance * part.face_normals[face]
    return uv, beyond


def _evaluate(fit: Fit, uv: Floats) -> Floats:
    knots, poles = fit
    return np.stack([NdBSpline(knots, poles[..., k], DEGREE)(uv) for k in range(3)], axis=-1)


def _trim(surface: Any, rims: Sequence[Floats]) -> Any:
    """The face of a surface within its rims, the outer one first."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace

    maker = BRepBuilderAPI_MakeFace(surface, build_wire(rims[0], surface), True)
    for rim in rims[1:]:
        maker.Add(build_wire(rim, surface))
    return maker.Face()
