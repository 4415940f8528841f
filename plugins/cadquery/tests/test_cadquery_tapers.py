"""Stock over edges that are smooth at one end, and what makes joined stock valid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Mesh
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

RADIUS, HIGH = 3.0, 0.5


def make_corner(more: float) -> Any:
    """A corner at (10, 10, 10) of two edges with fillets that meet in a sharp edge, all of it larger by ``more``."""

    def extrude(plane: str, sign: int) -> Any:
        side, radius = 10 + more, RADIUS + more
        profile = cq.Workplane(plane).moveTo(0, 0).lineTo(side, 0).lineTo(side, side - radius)
        profile = profile.threePointArc(
            (side - radius * (1 - np.sqrt(0.5)), side - radius * (1 - np.sqrt(0.5))), (side - radius, side)
        )
        return profile.lineTo(0, side).close().extrude(sign * 20)

    return extrude("XZ", -1).intersect(extrude("YZ", 1))


def test_an_edge_that_tapers_gets_a_mitre_that_tapers() -> None:
    """Where both fillets go over into the top, their common edge is smooth."""
    from damageest_cadquery.solids.split import is_watertight, measure_volume
    from damageest_cadquery.stock._edges import find_edges
    from damageest_cadquery.stock.offset_faces import Base, build_parts, build_stock

    faces = make_corner(0.0).val().Solids()[0].Faces()
    bases = [
        Base(face.wrapped, k, HIGH)
        for k, face in enumerate(faces)
        if face.geomType() == "CYLINDER" or face.Center().z > 9.99
    ]
    edges = find_edges([base.face for base in bases])
    assert sorted(edge.kind for edge in edges) == ["convex", "smooth", "smooth"]
    (edge,) = (edge for edge in edges if edge.kind == "convex")
    assert sorted((edge.tapers(0), edge.tapers(-1))) == [False, True]
    assert all(is_watertight(lump.solid, chord) for lump in build_parts(bases) for chord in (0.1, 0.02))
    (stock,) = build_stock(bases)
    assert cq.Shape.cast(stock).isValid()
    above = cq.Workplane().box(40, 40, 40).translate((0, 0, 20 + 10 - RADIUS))
    wanted = make_corner(HIGH).intersect(above).val().Volume() - make_corner(0.0).intersect(above).val().Volume()
    assert measure_volume(stock) == pytest.approx(wanted, rel=5e-3)


def move_edge(step: float) -> Any:
    """A cylinder whose upper rim lies this far above its faces, and claims 1e-7."""
    from damageest_cadquery.reading.read import explore
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.gp import gp_Vec
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    solid = BRepBuilderAPI_Copy(cq.Workplane().cylinder(20, 5).val().wrapped).Shape()
    for edge in map(TopoDS.Edge_s, explore(solid, TopAbs_EDGE)):
        if cq.Edge(edge).geomType() == "CIRCLE" and cq.Edge(edge).Center().z > 9:
            curve = BRep_Tool.Curve_s(edge, 0.0, 0.0).Translated(gp_Vec(0, 0, step))
            BRep_Builder().UpdateEdge(edge, curve, TopLoc_Location(), 1e-7)
    return solid


def test_an_edge_that_claims_too_little_is_settled_where_it_is_near() -> None:
    from damageest_cadquery.solids.joining import settle_edges

    assert settle_edges(move_edge(0.0))
    for step, wanted in ((2e-5, True), (0.05, False)):
        solid = move_edge(step)
        assert not cq.Shape.cast(solid).isValid()
        assert settle_edges(solid) == wanted
        assert cq.Shape.cast(solid).isValid() or not wanted


def test_triangles_that_lie_on_each_other_are_dropped() -> None:
    from damageest_cadquery.solids._folds import drop_folds

    faces = np.array([[13, 1, 34], [33, 1, 34], [1, 33, 34], [34, 1, 35], [1, 2, 3], [2, 1, 3]])
    number = np.array([1, 1, 1, 1, 1, 2])
    assert drop_folds(faces, number).tolist() == faces[[0, 3, 4, 5]].tolist(), "those of two faces stay"


def test_a_surface_of_which_a_vertex_joins_two_sheets_is_simplified() -> None:
    from damageest_cadquery.surfaces.flat_faces import Flat
    from damageest_cadquery.surfaces.polyhedron import decimate, split_sheets

    count = 12
    x, y = np.meshgrid(np.arange(count, dtype=float), np.arange(count, dtype=float))
    grid = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    assert len(split_sheets(Mesh(grid, faces)).vertices) == len(grid)
    # a second sheet that has one corner in common with the middle of the first
    other, middle = faces + len(grid), int(at[5, 5])
    upright = grid[:, [2, 0, 1]] + grid[middle]
    both = Mesh(np.concatenate([grid, upright]), np.concatenate([faces, np.where(other == len(grid), middle, other)]))
    apart = split_sheets(both)
    used = len(np.unique(both.faces))
    assert len(apart.vertices) == used + 1
    assert (apart.vertices[apart.faces] == both.vertices[both.faces]).all()
    flat = Flat(both, np.full(len(both.faces), -1), ())
    assert len(decimate(flat, 40).mesh.faces) < 80


@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_a_mitre_whose_ends_are_not_flat_is_closed(bend: float) -> None:
    """As where an edge of a file does not lie quite on its faces, so that their normals lean along it."""
    from dataclasses import replace

    from damageest_cadquery.solids.split import measure_volume
    from damageest_cadquery.stock._edges import find_edges
    from damageest_cadquery.stock._mitre import build_mitre

    faces = [face.wrapped for face in cq.Workplane().box(10, 10, 10).val().Faces()]
    edge = find_edges(faces)[0]
    assert edge.kind == "convex"
    along = np.linspace(0, 1, len(edge.points))[:, None]
    leaning = replace(
        edge, normals=edge.normals + 1e-4 * edge.tangents, others=edge.others - 2e-4 * edge.tangents,
        points=edge.points + bend * (along - along**2) * edge.normals,
    )  # fmt: skip
    solid = build_mitre(leaning, HIGH, HIGH)
    assert cq.Shape.cast(solid).isValid()
    assert measure_volume(solid) == pytest.approx(10 * HIGH**2, rel=1e-3)
    assert len(cq.Shape.cast(solid).Faces()) == 4 + 2 * 2, "each end is two triangles"


def test_a_mitre_that_reaches_beyond_the_axis_of_its_edge_folds() -> None:
    """Over the end of a concave fillet whose radius is less than the height of the stock."""
    from damageest_cadquery.solids.joining import StockError
    from damageest_cadquery.stock._edges import find_edges
    from damageest_cadquery.stock._mitre import build_mitre

    step = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (20, 5), (10, 5), (10, 15), (0, 15)]).close().extrude(10)
    solid = step.edges(cq.selectors.BoxSelector((9, -20, 4), (11, 20, 6))).fillet(RADIUS)
    edges = find_edges([face.wrapped for face in solid.val().Faces()])
    (first, *_) = [edge for edge in edges if edge.kind == "convex" and cq.Edge(edge.shape).geomType() == "CIRCLE"]
    assert cq.Shape.cast(build_mitre(first, RADIUS - 0.1, RADIUS - 0.1)).isValid()
    with pytest.raises(StockError, match="folds"):
        build_mitre(first, RADIUS + 0.1, RADIUS + 0.1)
