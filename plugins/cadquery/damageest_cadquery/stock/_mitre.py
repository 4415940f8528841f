"""The mitre of stock over a sharp convex edge: a polygon across the edge that goes along it."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.joining import StockError, orient_solid
from damageest_cadquery.stock._edges import SMOOTH, Edge

MAX_MITRE = 100.0
"""Largest angle in degrees between normals at an edge with a pointed mitre; a sharper edge gets `ROUNDS` points."""
ROUNDS = 3
LONG = 1.6
"""Largest length of a pointed mitre, in heights."""
FLAT = 1e-6
"""Distance in millimetres of a polygon's corners from a plane up to which it is flat."""
EVEN = 1e-6
"""Largest change of the polygon's corners along a straight or circular edge, in heights."""


def find_heads(edge: Edge, at: int, tall: float, other: float) -> Floats:
    """(K,3) vectors from the edge to the upper corners of its mitre: the first face's, the mitre's, the second's.

    ``at``: which of the edge's points; ``tall``, ``other``: heights on the first and on the second face. The same rule
    as that of the stage `allowance: milling`.
    """
    n, m, turn = edge.normals[at], edge.others[at], float(edge.turns[at])
    if abs(turn) <= SMOOTH:  # an end of it, where the mitre has no width
        if tall != other:
            raise StockError("the heights differ at an edge that is smooth at one end")
        return np.array([tall * n] * (3 if edge.turns[len(edge.turns) // 2] <= np.radians(MAX_MITRE) else 2 + ROUNDS))
    outward = np.cross(edge.tangents[at], n)
    aside = (other - tall * np.cos(turn)) / np.sin(turn)
    middle = edge.turns[len(edge.turns) // 2]
    if middle <= np.radians(MAX_MITRE) and np.hypot(tall, aside) <= LONG * max(tall, other):
        heads = [tall * n + aside * outward]
    elif middle <= np.radians(MAX_MITRE):  # different heights at a blunt edge would meet far away
        heads = []
    else:
        step = turn / ROUNDS
        heads = []
        for k in range(ROUNDS):
            angle, share = (k + 0.5) * step, (k + 0.5) / ROUNDS
            reach = ((1 - share) * tall + share * other) / np.cos(step / 2)
            heads.append(reach * (np.cos(angle) * n + np.sin(angle) * outward))
    return np.array([tall * n, *heads, other * m])


def build_mitre(edge: Edge, tall: float, other: float) -> Any:
    """The solid of a mitre. Raises StockError where OpenCASCADE cannot make it."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeRevol
    from OCP.gp import gp_Vec

    heads = np.stack([find_heads(edge, k, tall, other) for k in range(len(edge.points))])
    size = max(tall, other)
    way = edge.points[-1] - edge.points[0]
    length = float(np.linalg.norm(way))
    straight = length > 0 and np.abs(np.cross(edge.points - edge.points[0], way / length)).max() < EVEN * size
    flat = _is_flat(heads[0])
    if flat and straight and np.abs(heads - heads[0]).max() < EVEN * size:
        face = _build_polygon(edge.points[0], heads[0])
        return orient_solid(BRepPrimAPI_MakePrism(face, gp_Vec(*way.tolist())).Shape())
    turned = _find_turn(edge, heads, size) if flat else None
    if turned is not None:
        axis, angle = turned
        return orient_solid(BRepPrimAPI_MakeRevol(_build_polygon(edge.points[0], heads[0]), axis, angle).Shape())
    return orient_solid(_loft(edge.points, heads))


def _build_polygon(point: Floats, heads: Floats) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.gp import gp_Pnt

    polygon = BRepBuilderAPI_MakePolygon()
    for corner in [point, *(point + heads)]:
        polygon.Add(gp_Pnt(*corner.tolist()))
    polygon.Close()
    return BRepBuilderAPI_MakeFace(polygon.Wire(), True).Face()


def _build_end(point: Floats, heads: Floats) -> list[Any]:
    """The end of a mitre: a polygon, or triangles where it is not flat, as where an edge does not lie quite on its
    faces; nothing where it has no width."""
    if np.abs(heads - heads[0]).max() == 0:
        return []
    if _is_flat(heads):
        return [_build_polygon(point, heads)]
    return [_build_polygon(point, heads[k : k + 2]) for k in range(len(heads) - 1)]


def _is_flat(heads: Floats) -> bool:
    corners = np.vstack([np.zeros(3), heads])
    return bool(np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] <= FLAT)


def _find_turn(edge: Edge, heads: Floats, size: float) -> tuple[Any, float] | None:
    """The axis and angle by which the polygon turns along a circular edge; None where it does not. Raises StockError
    where it would reach beyond the axis."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_Circle
    from OCP.gp import gp_Ax1

    curve = BRepAdaptor_Curve(edge.shape)
    if curve.GetType() != GeomAbs_Circle:
        return None
    circle = curve.Circle()
    axis, centre = np.array(circle.Axis().Direction().Coord()), np.array(circle.Location().Coord())
    angle = curve.LastParameter() - curve.FirstParameter()
    spokes = edge.points - centre
    if np.cross(spokes[0], edge.tangents[0]) @ axis < 0:
        axis = -axis
    radial = normalise(spokes)
    along = np.cross(axis, radial)
    frames = np.stack([radial, along, np.broadcast_to(axis, radial.shape)], axis=1)  # (S,3,3)
    seen = np.einsum("sij,skj->ski", frames, heads)
    if np.abs(seen - seen[0]).max() > 10 * EVEN * size:
        return None
    if (circle.Radius() + seen[0, :, 0]).min() <= 0:  # as inside a fillet, beyond whose axis it would lie
        raise StockError("the offset of a face folds")
    line = gp_Ax1(circle.Location(), circle.Axis().Direction())
    if np.array(circle.Axis().Direction().Coord()) @ axis < 0:
        line.Reverse()
    return line, angle


def _loft(points: Floats, heads: Floats) -> Any:
    """A mitre along any edge: ruled faces between curves through its corners. ``points`` (S,3), ``heads`` (S,K,3)."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
    from OCP.GeomFill import GeomFill
    from OCP.TopAbs import TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    parameters = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    corners = np.concatenate([points[:, None], points[:, None] + heads], axis=1)
    curves = [_interpolate(corners[:, k], parameters) for k in range(corners.shape[1])]
    sewing = BRepBuilderAPI_Sewing(1e-5)
    for one, two in zip(curves, [*curves[1:], curves[0]], strict=True):
        sewing.Add(BRepBuilderAPI_MakeFace(GeomFill.Surface_s(one, two), 1e-7).Face())
    if np.linalg.norm(points[0] - points[-1]) > 1e-6:
        for end in (0, -1):
            for face in _build_end(points[end], heads[end]):
                sewing.Add(face)
    sewing.Perform()
    shells = explore(sewing.SewedShape(), TopAbs_SHELL)
    if len(shells) != 1:
        raise StockError("the mitre over a sharp edge is not closed")
    return BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(shells[0])).Solid()


def _interpolate(points: Floats, parameters: Floats) -> Any:
    from OCP.GeomAPI import GeomAPI_Interpolate
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_HArray1OfPnt
    from OCP.TColStd import TColStd_HArray1OfReal

    places, times = TColgp_HArray1OfPnt(1, len(points)), TColStd_HArray1OfReal(1, len(points))
    for k, (point, time) in enumerate(zip(points.tolist(), parameters.tolist(), strict=True)):
        places.SetValue(k + 1, gp_Pnt(*point))
        times.SetValue(k + 1, time)
    curve = GeomAPI_Interpolate(places, times, False, 1e-9)
    curve.Perform()
    if not curve.IsDone():
        raise StockError("no curve goes along the mitre over a sharp edge")
    return curve.Curve()
