"""CAD files that hold metal twice: an assembly, and its parts fused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Surface
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")
TOLERANCE = 0.2


def find(blocks: list[Any], monkeypatch: pytest.MonkeyPatch) -> tuple[Any, tuple[str, ...]]:
    """The exact form of what lies beyond x = 12 of a block of 30 x 20 x 12, whose file holds these solids."""
    from damageest_cadquery.cutting import exact_damage as _exact
    from damageest_cadquery.cutting._attempts import Attempt
    from damageest_cadquery.solids.split import Tool
    from test_cadquery_balance import cut_off, mesh_part

    part = mesh_part(cq.Workplane().box(30, 20, 12), 0.1)
    face = cq.Face.makePlane(40, 40, (12, 0, 0), (1, 0, 0)).wrapped

    def list_tools(*_: Any) -> Iterator[Attempt]:
        yield Attempt("facets 2", lambda: Tool([face], face), (1e-6,))

    monkeypatch.setattr(_exact, "make_cut", lambda *_: object())
    monkeypatch.setattr(_exact, "list_tools", list_tools)
    lost = cut_off(part, 12.0)
    corners = np.array([[12, y, z] for y in (-10, 10) for z in (-6, 6)], float)
    surface = Surface(corners, np.array([[0, 1, 3], [0, 3, 2]]))
    site = _exact.SiteInput(1, lost, surface, (lost,), np.empty((0, 3)), True)
    solids, faces = _exact.start_solids([block.val().wrapped for block in blocks])
    return _exact.find_exact(site, solids, faces, part, TOLERANCE)


def test_metal_that_a_file_holds_twice_is_taken_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from damageest_cadquery.solids.split import measure_volume

    whole = cq.Workplane().box(30, 20, 12)
    halves = [cq.Workplane().box(30, 10, 12).translate((0, y, 0)) for y in (-5, 5)]
    for blocks, owners, left in (([*halves, whole], [2], 3), (halves, [0, 1], 2), ([whole, whole], [0], 2)):
        found, tried = find(blocks, monkeypatch)
        assert found is not None, tried
        assert [piece.owner for piece in found.pieces] == owners
        assert sum(measure_volume(piece.shape) for piece in found.pieces) == pytest.approx(3 * 20 * 12)
        assert len(found.rest) == left, "it is cut out of each solid"


def test_metal_that_solids_share_in_part_is_taken_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second solid's damage volume ends where the first has the metal: there it has a face of that, which gets no
    stock, since it is no skin of the part."""
    from damageest_cadquery.solids.doubles import SHARED
    from damageest_cadquery.solids.split import find_corners, is_sound, measure_volume
    from damageest_cadquery.stock.offset_faces import take_bases

    halves = [cq.Workplane().box(30, 14, 12).translate((0, y, 0)) for y in (-3, 3)]
    found, tried = find(halves, monkeypatch)
    assert found is not None, tried
    one, two = found.pieces
    assert [measure_volume(piece.shape) for piece in (one, two)] == pytest.approx([3 * 14 * 12, 3 * 6 * 12])
    assert find_corners(two.shape)[:, 1].min() == pytest.approx(4), "the larger one, or the first of equals, is whole"
    shared = [number for number, kind in two.origins if kind == SHARED]
    assert [number < 6 for number in shared] == [True], "the side of the first solid"
    assert is_sound(found.pieces)
    assert sum(measure_volume(piece.shape) for piece in found.doubles) == pytest.approx(3 * 8 * 12)
    heights = dict.fromkeys(range(12), 0.5)
    assert {base.number for base in take_bases(two, heights)} == {
        number for number, kind in two.origins if kind == -1 and number >= 0
    }
    assert sum(measure_volume(piece.shape) for piece in found.rest) == pytest.approx(2 * 27 * 14 * 12)


def test_stock_on_a_face_of_the_other_solid_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from damageest_cadquery.solids.joining import StockError
    from damageest_cadquery.stock.deposit import refuse_doubles
    from test_cadquery_balance import cut_off, mesh_part

    from damageest.artefacts import Deposit

    whole = cq.Workplane().box(30, 20, 12)
    lost = cut_off(mesh_part(whole, 0.1), 12.0)
    found, tried = find([whole, whole], monkeypatch)
    assert found is not None, tried
    assert [piece.owner for piece in found.doubles] == [1]

    def make(*numbers: int) -> Deposit:
        return Deposit(lost.vertices, lost.faces, heights=tuple((number, 0.5) for number in numbers), stock_volume=1.0)

    own = next(number for number, _ in found.pieces[0].origins if number >= 0)
    refuse_doubles(make(own), found.pieces, found.doubles)
    with pytest.raises(StockError, match="holds this metal twice"):
        refuse_doubles(make(own, own + 6), found.pieces, found.doubles)
    refuse_doubles(make(own, own + 6), found.pieces, ())
