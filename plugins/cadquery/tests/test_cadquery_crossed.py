"""Faces of a CAD file that cross one another are named where a site has no exact form."""

from __future__ import annotations

from typing import Any

import pytest

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


def make_solid(*blocks: Any) -> Any:
    """One solid of the faces of all blocks, which may cross."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for block in blocks:
        for face in block.val().Faces():
            builder.Add(shell, face.wrapped)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def test_faces_that_cross_near_the_damage_are_found() -> None:
    from damageest_cadquery.cutting.crossed import find_crossed
    from damageest_cadquery.cutting.exact_damage import start_solids
    from test_cadquery_balance import cut_off, mesh_part

    block = cq.Workplane().box(30, 20, 12)
    part, rod = mesh_part(block, 0.1), cq.Workplane().box(10, 4, 4).translate((15, 0, 0))
    for blocks, at, wanted in (
        ((block, rod), 12.0, 5),
        ((block,), 12.0, 0),
        ((block, rod.translate((20, 0, 0))), 12.0, 0),
    ):
        pieces, faces = start_solids([make_solid(*blocks)])
        crossed = find_crossed(pieces, faces, cut_off(part, at), 0.2)
        assert len(crossed) == wanted
    pieces, faces = start_solids([make_solid(block, rod)])
    sides = [cq.Face(faces[k]).normalAt().toTuple() for k in find_crossed(pieces, faces, cut_off(part, 12.0), 0.2)]
    assert sides[0] == pytest.approx((1, 0, 0)), "the end of the block, and the four sides of the rod"
    assert all(abs(side[0]) < 1e-9 for side in sides[1:])
    far = cut_off(part, 12.0)
    assert find_crossed(pieces, faces, type(far)(far.vertices - [20, 0, 0], far.faces), 0.2) == []


def test_solids_that_overlap_are_no_fault_of_their_faces() -> None:
    from damageest_cadquery.cutting.crossed import find_crossed
    from damageest_cadquery.cutting.exact_damage import start_solids
    from test_cadquery_balance import cut_off, mesh_part

    block = cq.Workplane().box(30, 20, 12)
    other = cq.Workplane().box(10, 4, 4).translate((15, 0, 0))
    pieces, faces = start_solids([block.val().wrapped, other.val().wrapped])
    assert find_crossed(pieces, faces, cut_off(mesh_part(block, 0.1), 12.0), 0.2) == []
