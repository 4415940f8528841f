"""Stock on CAD faces: each face's own offset, with straight walls along its normal at the border.

Over smooth edges the offsets of neighbouring faces meet. A sharp convex edge gets a mitre, whose sides continue the
offsets; it is blunt where the edge is sharper than a right angle. The shape is that of the stage `allowance: milling`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from damageest.artefacts import Floats, Ints
from damageest.geometry.vectors import cross_corners
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.doubles import SHARED
from damageest_cadquery.solids.joining import StockError, close, explore_faces, naming, orient_solid, settle_edges
from damageest_cadquery.solids.split import Piece, is_watertight, measure_volume
from damageest_cadquery.stock._edges import Edge, find_edges, measure_normals
from damageest_cadquery.stock._join import Lump, fuse, sew_all
from damageest_cadquery.stock._mitre import build_mitre, find_heads
from damageest_cadquery.stock._walls import build_wall
from damageest_cadquery.stock._wedge import build_end, build_wedge, is_narrow

FLAT = 1e-6
"""Volume of a corner, in cubes of the height, below which there is none."""
SAME = 1e-4
"""Distance between corners of mitres, in extents of what fills the corner, within which they are one."""
CHORDS = 16
"""Chords of triangles in a height of the stock, where it is tried whether triangles of a solid close."""


@dataclass(frozen=True, eq=False)
class Base:
    """A face under stock: its ``number`` in the CAD file and the ``height`` of the stock."""

    face: Any
    number: int
    height: float


def take_bases(piece: Piece, heights: Mapping[int, float]) -> list[Base]:
    """The outer faces of a damage volume that get stock. Raises StockError where a face has no height of its own."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    bases = []
    for face, (number, kind) in zip(explore(piece.shape, TopAbs_FACE), piece.origins, strict=True):
        if number < 0 or kind == SHARED:
            continue
        height = heights.get(number, 0.0)  # a sliver that the mesh does not have gets none
        if height < 0:
            raise StockError("its height is not the same all over the face", (number,))
        if height > 0:
            bases.append(Base(TopoDS.Face_s(face), number, height))
    return bases


def build_stock(bases: Sequence[Base]) -> list[Any]:
    """The solids of the stock; they share no volume. Raises StockError where OpenCASCADE cannot make them."""
    return join_stock(build_parts(bases), bases)


def build_parts(bases: Sequence[Base]) -> list[Lump]:
    """Solids whose union is the stock: over smooth faces, over sharp edges and at corners. In concave corners they
    share volume. Raises StockError where OpenCASCADE cannot make them."""
    edges = find_edges([base.face for base in bases])
    heights = [base.height for base in bases]
    if mixed := [edge for edge in edges if edge.kind == "mixed"]:
        raise StockError(
            "an edge between the faces is sharp in part only, or changes between convex and concave",
            (bases[k].number for edge in mixed for k in (edge.first, edge.second)),
        )
    narrow = _find_narrow(edges, bases)
    label = _group([edge for edge in edges if not {edge.first, edge.second} & narrow], heights)
    lumps = []
    for number in range(int(label.max()) + 1):
        mine = [bases[k] for k in np.flatnonzero(label == number).tolist()]
        with naming(base.number for base in mine):
            wedge = label.tolist().index(number) in narrow
            solid = build_wedge(mine[0].face) if wedge else _thicken([base.face for base in mine], mine[0].height)
        lumps.append(Lump(solid, tuple(base.number for base in mine)))
    sharp = [edge for edge in edges if edge.kind == "convex"]
    for edge in sharp:
        numbers = (bases[edge.first].number, bases[edge.second].number)
        with naming(numbers):
            lumps.append(Lump(_build_mitre(edge, bases, narrow), numbers))
    return lumps + _build_corners(sharp, bases)


def _build_mitre(edge: Edge, bases: Sequence[Base], narrow: set[int]) -> Any:
    """The stock over a sharp convex edge."""
    first, second = bases[edge.first], bases[edge.second]
    if edge.first in narrow and edge.second not in narrow:
        return build_end(edge.shape, first.face, edge.others, second.height)
    if edge.second in narrow and edge.first not in narrow:
        return build_end(edge.shape, second.face, edge.normals, first.height)
    return build_mitre(edge, first.height, second.height)


def _find_narrow(edges: Sequence[Edge], bases: Sequence[Base]) -> set[int]:
    """Fillets whose radius is less than the stock is high; beyond their axis the stock is that of their neighbours."""
    smooth = {k for edge in edges if edge.kind == "smooth" for k in (edge.first, edge.second)}
    return {k for k in smooth if is_narrow(bases[k].face, bases[k].height)}


def _group(edges: Sequence[Edge], heights: Sequence[float]) -> Ints:
    """(B,) the group of each face: those of one height that are smooth together. Two faces with a sharp edge are never
    in one, though they may be smooth with a third: what is offset in one piece must not have a sharp edge in it."""
    label = np.arange(len(heights))
    sharp = [(edge.first, edge.second) for edge in edges if edge.kind != "smooth"]
    smooth = [edge for edge in edges if edge.kind == "smooth" and heights[edge.first] == heights[edge.second]]
    for edge in sorted(smooth, key=lambda each: -each.length):
        one, two = sorted((int(label[edge.first]), int(label[edge.second])))
        after = np.where(label == two, one, label)
        if one != two and all(after[first] != after[second] for first, second in sharp):
            label = after
    return np.unique(label, return_inverse=True)[1].reshape(-1)


def join_stock(parts: Sequence[Lump], bases: Sequence[Base]) -> list[Any]:
    """The union of the parts of the stock on some faces. Raises StockError where OpenCASCADE cannot make it."""
    if len(parts) == 1:
        return [parts[0].solid]
    edges = find_edges([base.face for base in bases])
    apart = all(edge.kind in ("smooth", "convex") for edge in edges) and not _find_narrow(edges, bases)
    with naming(base.number for base in bases):
        chord = min(base.height for base in bases) / CHORDS
        found = sew_all(parts, chord) if apart else None
        return _merge(fuse(parts, chord) if found is None else found, bases)


def _thicken(faces: Sequence[Any], height: float) -> Any:
    """The solid between faces that are smooth together and their offset."""
    from OCP.BRep import BRep_Builder
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepOffset import BRepOffset_MakeSimpleOffset
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.GeomAbs import GeomAbs_Plane
    from OCP.gp import gp_Vec
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS, TopoDS_Shell

    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    adaptor = BRepAdaptor_Surface(faces[0])
    if len(faces) == 1 and adaptor.GetType() == GeomAbs_Plane:  # of several, a prism would be several solids
        plane = adaptor.Plane()
        normal = gp_Vec(plane.Axis().Direction())
        if plane.Direct() == (faces[0].Orientation() == TopAbs_REVERSED):
            normal.Reverse()
        return orient_solid(BRepPrimAPI_MakePrism(faces[0], normal.Multiplied(height)).Shape())
    border = _find_border(faces)
    for way in (height, -height):  # for some cones OpenCASCADE takes the normal that points the other way
        maker = BRepOffset_MakeSimpleOffset(shell, way)
        maker.Perform()
        if not maker.IsDone():
            raise StockError("OpenCASCADE finds no offset of a face")
        tops = [TopoDS.Edge_s(maker.Generated(edge)) for edge in border]
        if _is_outside(faces, border, tops):
            walls = [build_wall(edge, top) for edge, top in zip(border, tops, strict=True)]
            return orient_solid(close([*faces, *explore_faces(maker.GetResultShape()), *walls]))
    raise StockError("OpenCASCADE finds no offset of a face on its outer side")


def _is_outside(faces: Sequence[Any], border: Sequence[Any], tops: Sequence[Any]) -> bool:
    """Whether the edges ``tops``, which lie over the edges of the border, lie on the outer side of the faces."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopoDS import TopoDS

    index = {hash(edge): k for k, edge in enumerate(border)}
    rises = []
    for face in faces:
        for edge in explore(face, TopAbs_EDGE):
            k = index.get(hash(edge))
            if k is None or not edge.IsSame(border[k]):
                continue
            curve, top = BRepAdaptor_Curve(border[k]), BRepAdaptor_Curve(tops[k])
            at, end = (
                each.FirstParameter() + 0.5 * (each.LastParameter() - each.FirstParameter()) for each in (curve, top)
            )
            normal = measure_normals(TopoDS.Edge_s(edge), face, np.array([at]))[0]
            rises.append(normal @ np.subtract(top.Value(end).Coord(), curve.Value(at).Coord()))
    return bool(sum(rises) >= 0)


def _find_border(faces: Sequence[Any]) -> list[Any]:
    """The edges that one of the faces has alone."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    index = TopTools_IndexedMapOfShape()
    edges: dict[int, Any] = {}
    times: dict[int, int] = {}
    for face in faces:
        for edge in explore(face, TopAbs_EDGE):
            if not BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge)):
                key = index.Add(edge)
                edges[key] = TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD))
                times[key] = times.get(key, 0) + 1
    return [edge for key, edge in edges.items() if times[key] == 1]


def _build_corners(sharp: Sequence[Edge], bases: Sequence[Base]) -> list[Lump]:
    """The pieces where mitres meet: hulls of the vertex and the upper points of the mitres there."""
    from OCP.TopTools import TopTools_IndexedMapOfShape

    index = TopTools_IndexedMapOfShape()
    clouds: dict[int, list[Floats]] = {}
    places: dict[int, Floats] = {}
    around: dict[int, set[int]] = {}
    for edge in sharp:
        one, two = bases[edge.first], bases[edge.second]
        for end in (0, -1):
            vertex = edge.vertices[end]
            key = index.Add(vertex)
            place = edge.points[end]
            places.setdefault(key, place)
            clouds.setdefault(key, []).append(place + find_heads(edge, end, one.height, two.height))
            around.setdefault(key, set()).update((one.number, two.number))
    lumps = []
    for key, cloud in clouds.items():
        if len(cloud) < 2:
            continue
        points = np.concatenate([places[key][None], *cloud])
        size = float(np.ptp(points, axis=0).max())
        points = merge_points(points, SAME * size)
        if len(points) < 4:
            continue
        flat = np.linalg.svd((points - points.mean(axis=0)) / size, compute_uv=False)[2]
        if flat < 1e-3:
            continue  # an edge that goes straight on
        hull = ConvexHull(points)
        if hull.volume < FLAT * size**3:
            continue
        with naming(around[key]):
            lumps.append(Lump(_build_hull(hull), tuple(sorted(around[key]))))
    return lumps


def merge_points(points: Floats, near: float) -> Floats:
    """(K,3) points (N,3) without those within ``near`` of an earlier one: mitres of edges that end on one face have a
    corner in common, but for rounding errors, between which a hull has slivers."""
    taken = np.ones(len(points), bool)
    for one, two in sorted(cKDTree(points).query_pairs(near)):
        taken[two] &= not taken[one]
    return np.asarray(points[taken])


def _build_hull(hull: ConvexHull) -> Any:
    """A convex polyhedron with one face for each plane."""
    from damageest.artefacts import Solid
    from damageest_cadquery.solids.planar import build_solid

    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    points = hull.points[used]
    corners = points[faces]
    turned = np.einsum("ij,ij->i", cross_corners(corners),
                       hull.equations[:, :3]) < 0  # fmt: skip
    faces[turned] = faces[turned][:, ::-1]
    return orient_solid(build_solid(Solid(points, faces))[0])


def _merge(solids: Sequence[Any], bases: Sequence[Base]) -> list[Any]:
    """The solids with the sides of mitres joined to the offsets that they continue."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_SOLID

    merged = []
    for solid in solids:
        spare = BRepBuilderAPI_Copy(solid).Shape()  # OpenCASCADE changes edges of the solid that it is given
        unify = ShapeUpgrade_UnifySameDomain(solid, False, True, False)
        for base in bases:
            for edge in explore(base.face, TopAbs_EDGE):
                unify.KeepShape(edge)
        unify.Build()
        (found,) = explore(unify.Shape(), TopAbs_SOLID) or (None,)
        sound = found is not None and BRepCheck_Analyzer(found).IsValid()
        same = sound and abs(measure_volume(found) / measure_volume(solid) - 1) < 1e-6
        settle_edges(spare)
        merged.append(found if same and is_watertight(found, bases[0].height / CHORDS) else spare)
    return merged
