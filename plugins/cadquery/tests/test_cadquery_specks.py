"""Small bodies of a damage volume, and triangles that do not close at first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Solid, Surface
from damageest.errors import InputError
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")
TOLERANCE = 0.2


@pytest.mark.parametrize(("size", "kept"), [((0.09, 2, 2), [720]), ((0.7, 0.7, 0.7), [720, 0.343])])
def test_a_small_body_of_the_damage_is_no_cut_elsewhere(
    size: tuple[float, float, float], kept: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A corner of 0.0005 of the damage volume. Where its inner faces are the only ones near the mesh's, it is kept."""
    from damageest_cadquery.cutting import exact_damage as _exact
    from damageest_cadquery.cutting._attempts import Attempt
    from damageest_cadquery.solids.split import Tool, measure_volume
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound
    from test_cadquery_balance import mesh_part

    low, high = np.array([-15.0, 10 - size[1], 6 - size[2]]), np.array([-15 + size[0], 10.0, 6.0])
    block, middle = cq.Workplane().box(30, 20, 12), (low + high) / 2
    bits = [cq.Workplane().box(3, 20, 12).translate((13.5, 0, 0)), cq.Workplane().box(*size).translate(tuple(middle))]
    meshes = [mesh_part(each, 0.1) for each in bits]
    lost = Solid(
        np.concatenate([each.vertices for each in meshes]),
        np.concatenate([meshes[0].faces, meshes[1].faces + len(meshes[0].vertices)]),
    )
    around = cq.Workplane().box(*(2 * np.array(size))).translate((-15, 10, 6)).val()  # its outer half is in the air
    inside = [face.wrapped for face in around.Faces() if (np.abs(face.Center().toTuple() - middle) < size).all()]
    assert len(inside) == 3
    walls = [cq.Face.makePlane(40, 40, (12, 0, 0), (1, 0, 0)).wrapped, *inside]
    builder, tool = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(tool)
    for wall in walls:
        builder.Add(tool, wall)

    def list_tools(*_: Any) -> Iterator[Attempt]:
        yield Attempt("facets 2", lambda: Tool(walls, tool), (1e-6,))

    monkeypatch.setattr(_exact, "make_cut", lambda *_: object())
    monkeypatch.setattr(_exact, "list_tools", list_tools)
    sheets = [np.array([[12, y, z] for y in (-10, 10) for z in (-6, 6)], float)]
    for axis, at in enumerate((high[0], low[1], low[2])):
        ends = [(low[k], high[k]) if k != axis else (at,) for k in range(3)]
        sheets.append(np.array([[x, y, z] for x in ends[0] for y in ends[1] for z in ends[2]]))
    rows = np.array([[0, 1, 3], [0, 3, 2]])
    surface = Surface(np.concatenate(sheets), np.concatenate([rows + 4 * k for k in range(4)]))
    site = _exact.SiteInput(1, lost, surface, (lost,), np.empty((0, 3)), True)
    solids, faces = _exact.start_solids([block.val().wrapped])
    found, tried = _exact.find_exact(site, solids, faces, mesh_part(block, 0.1), TOLERANCE)
    assert found is not None, tried
    assert [measure_volume(piece.shape) for piece in found.pieces] == pytest.approx(kept, rel=1e-6)


def test_triangles_that_do_not_close_are_made_once_more_of_half_the_chord(monkeypatch: pytest.MonkeyPatch) -> None:
    from damageest_cadquery.reading import tessellate as _tessellate
    from damageest_cadquery.solids import split as _split

    made, tried = _tessellate.tessellate, []

    def leave_gap(solids: list[Any], chord: float, *more: Any) -> Any:
        tried.append(chord)
        if chord > 0.06:
            raise InputError("an edge is divided differently by two faces")
        return made(solids, chord, *more)

    monkeypatch.setattr(_tessellate, "tessellate", leave_gap)
    ball = cq.Workplane().sphere(5).val().wrapped
    assert _split.triangulate(ball, 0.1).volume == pytest.approx(4 / 3 * np.pi * 125, rel=0.02)
    assert tried == [0.1, 0.05]
    assert not _split.is_watertight(ball, 0.1), "for joined stock this tells that it is not sound"
    with pytest.raises(InputError):
        _split.triangulate(ball, 0.2)
