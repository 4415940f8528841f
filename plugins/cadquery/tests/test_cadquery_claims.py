"""CAD solids that claim larger tolerances for their edges than they need."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


def make_claiming(claim: float) -> Any:
    """A cylinder whose edges claim a tolerance that they do not need."""
    from damageest_cadquery.reading.read import explore
    from OCP.BRep import BRep_Builder
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopoDS import TopoDS

    solid = cq.Workplane().cylinder(20, 10).val().wrapped
    for edge in explore(solid, TopAbs_EDGE):
        BRep_Builder().UpdateEdge(TopoDS.Edge_s(edge), claim)
    return solid


def split_at(solid: Any, z: float) -> list[float]:
    """The volumes of what a plane divides a solid into."""
    from damageest_cadquery.solids.split import Tool, measure_volume, split

    plane = cq.Face.makePlane(40, 40, (0, 0, z), (0, 0, 1)).wrapped
    pieces = split(solid, 0, [(k, -1) for k in range(3)], Tool([plane], plane), 1e-6)
    return sorted(measure_volume(piece.shape) for piece in pieces or ())


def test_a_claim_that_is_not_needed_is_lowered() -> None:
    from damageest_cadquery.reading.claims import lower_claims

    true = [np.pi * 100 * 0.5, np.pi * 100 * 19.5]
    wrong = make_claiming(1.5)
    assert split_at(wrong, 9.5) != pytest.approx(true, rel=1e-6), "OpenCASCADE takes the cut for the edge"
    lowered = lower_claims(wrong, 0.002)
    assert split_at(lowered, 9.5) == pytest.approx(true, rel=1e-6)
    assert split_at(wrong, 9.5) != pytest.approx(true, rel=1e-6), "what was given is not changed"


def test_other_claims_stay() -> None:
    from damageest_cadquery.reading.claims import lower_claims
    from OCP.BRepCheck import BRepCheck_Analyzer

    small = make_claiming(0.001)
    assert lower_claims(small, 0.002) is small
    needed = make_gap(0.05)
    assert BRepCheck_Analyzer(needed).IsValid()
    assert lower_claims(needed, 0.002) is needed, "an edge that lies off its face needs what it claims"


def make_gap(off: float, claim: float | None = None) -> Any:
    """A cylinder whose upper edge lies off its faces, and says so unless it claims less."""
    from damageest_cadquery.reading.read import explore
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.Geom import Geom_Circle
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    solid = BRepBuilderAPI_Copy(cq.Workplane().cylinder(20, 10).val().wrapped).Shape()
    builder, claim = BRep_Builder(), 2 * off if claim is None else claim
    for edge in explore(solid, TopAbs_EDGE):
        if cq.Edge(edge).geomType() == "CIRCLE" and cq.Edge(edge).Center().z > 9:
            circle = Geom_Circle(gp_Ax2(gp_Pnt(0, 0, 10), gp_Dir(0, 0, 1)), 10 + off)
            builder.UpdateEdge(TopoDS.Edge_s(edge), circle, TopLoc_Location(), claim)
    for corner in explore(solid, TopAbs_VERTEX):
        builder.UpdateVertex(TopoDS.Vertex_s(corner), claim)
    return solid


def test_a_corner_on_an_edge_of_the_part_is_not_off_the_part() -> None:
    from damageest_cadquery.cutting.check_pieces import _measure_off
    from damageest_cadquery.solids.joining import explore_faces
    from damageest_cadquery.solids.split import Tool, find_corners, split

    solid = make_gap(0.05)
    faces, plane = explore_faces(solid), cq.Face.makePlane(40, 40, (3, 0, 0), (1, 0, 0)).wrapped
    pieces = split(solid, 0, [(k, -1) for k in range(3)], Tool([plane], plane), 1e-6)
    assert pieces is not None
    assert len(pieces) == 2
    count = 0
    for piece in pieces:
        for face, (number, _) in zip(explore_faces(piece.shape), piece.origins, strict=True):
            corners = find_corners(face)
            count += int((np.hypot(*corners.T[:2]) > 10.01).sum()) if number >= 0 else 0
            if number >= 0:
                assert _measure_off(face, faces[number], 1e-5) < 1e-6
                moved = cq.Face(face).translate(cq.Vector(0.0, 0.03, 0.03)).wrapped
                assert _measure_off(moved, faces[number], 1e-5) > 0.01, "other corners have to be on the face"
    assert count > 4, "corners that lie off their face"


def test_a_piece_that_is_not_valid_is_refused_before_it_is_triangulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """The triangles of such a piece can take minutes."""
    from damageest_cadquery.cutting import _pieces
    from damageest_cadquery.cutting.exact_damage import start_solids
    from damageest_cadquery.solids.split import Tool, triangulate
    from test_cadquery_balance import cut_off, mesh_part

    lost = cut_off(mesh_part(cq.Workplane().cylinder(20, 10), 0.01), -20.0)
    plane = cq.Face.makePlane(40, 40, (7, 0, 0), (1, 0, 0)).wrapped
    triangulated: list[Any] = []

    def note(shape: Any, chord: float) -> Any:
        triangulated.append(shape)
        return triangulate(shape, chord)

    def take(solid: Any) -> Any:
        triangulated.clear()
        pieces, _ = start_solids([solid])
        monkeypatch.setattr(_pieces, "split", lambda *_: list(pieces))
        return _pieces.take_pieces(pieces, Tool([plane], plane), 1e-6, lost, 0.2)

    monkeypatch.setattr(_pieces, "triangulate", note)
    taken = take(make_gap(0.0))
    found = (taken.damage, taken.rest, taken.doubles, taken.specks)
    assert [len(each) for each in (*found, triangulated)] == [1, 0, 0, 0, 1]
    assert take(make_gap(0.05, claim=1e-7)) == "not valid (BRepCheck)"
    assert not triangulated


def make_bulge() -> Any:
    """A cube of 20 whose edge at y = z = 10 bulges from its two faces, and claims that it does not."""
    from damageest_cadquery.reading.read import explore
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    solid = BRepBuilderAPI_Copy(cq.Workplane().box(20, 20, 20).val().wrapped).Shape()
    for edge in map(TopoDS.Edge_s, explore(solid, TopAbs_EDGE)):
        middle = cq.Edge(edge).Center()
        if middle.y > 9 and middle.z > 9:
            line = BRep_Tool.Curve_s(edge, 0.0, 0.0)
            poles, knots, many = TColgp_Array1OfPnt(1, 3), TColStd_Array1OfReal(1, 2), TColStd_Array1OfInteger(1, 2)
            ends = [np.array(line.Value(at).Coord()) for at in (0.0, 20.0)]
            for k, point in enumerate((ends[0], (ends[0] + ends[1]) / 2 + [0, 0.1, 0.1], ends[1])):
                poles.SetValue(k + 1, gp_Pnt(*point.tolist()))
            for k, at in enumerate((0.0, 20.0)):
                knots.SetValue(k + 1, at)
                many.SetValue(k + 1, 3)
            BRep_Builder().UpdateEdge(edge, Geom_BSplineCurve(poles, knots, many, 2), TopLoc_Location(), 1e-7)
    return solid


def test_faults_of_the_file_that_no_cut_touches_are_no_faults_of_the_cut() -> None:
    from damageest_cadquery.solids.joining import explore_faces
    from damageest_cadquery.solids.split import Tool, is_sound, measure_volume, split
    from OCP.BRepCheck import BRepCheck_Analyzer

    solid = make_bulge()
    faces = explore_faces(solid)
    assert sum(not BRepCheck_Analyzer(face).IsValid() for face in faces) == 2

    def cut(y: float, z: float) -> list[Any]:
        """The pieces that a plane through (0, y, z) makes, parallel to x and across the way to the middle."""
        plane = cq.Face.makePlane(60, 60, (0, y, z), (0, y, z)).wrapped
        pieces = split(solid, 0, [(k, -1) for k in range(6)], Tool([plane], plane), 1e-6)
        assert pieces is not None
        return sorted(pieces, key=lambda piece: measure_volume(piece.shape))

    small, large = cut(-9, -9)
    assert measure_volume(small.shape) == pytest.approx(2 * 2 / 2 * 20, rel=1e-4)
    assert is_sound([small])
    assert is_sound([large], faces)
    assert not is_sound([large]), "not without knowing the file"
    assert not all(is_sound([piece], faces) for piece in cut(9, -9)), "the cut goes through one of these faces"


def test_a_coarser_fuzzy_value_is_tried_where_edges_claim_as_much() -> None:
    from damageest_cadquery.reading.claims import COARSE, find_coarse
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.ShapeFix import ShapeFix_ShapeTolerance

    exact = cq.Workplane().box(200, 200, 200).val().wrapped
    loose = BRepBuilderAPI_Copy(exact).Shape()
    ShapeFix_ShapeTolerance().SetTolerance(loose, 4e-3)
    assert find_coarse([exact], 5.0) == ()
    assert find_coarse([exact, loose], 5.0) == (COARSE,)
    assert find_coarse([loose], 0.5) == (), "for this tolerance it is not small"
