"""Stock that is higher than the radius of the fillet that it stands on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_cadquery.solids.joining import StockError, explore_faces
from damageest_cadquery.solids.split import measure_volume
from damageest_cadquery.stock._wedge import build_wedge, is_narrow
from damageest_cadquery.stock.offset_faces import Base, build_stock
from hypothesis import given, settings
from hypothesis import strategies as st

import damageest
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

RADIUS, HIGH = 3.0, 4.0
SECTION = 7 * HIGH * 2 - 1 + np.pi * RADIUS**2 / 4
"""Of the stock on a fillet and 7 mm of the planes on both sides; these overlap in a square."""


def make_angle(length: float = 40.0) -> Any:
    """An angle section from y = -length to 0, with a fillet in its corner at x = z = 10."""
    outline = [(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)]
    body = cq.Workplane("XZ").polyline(outline).close().extrude(length)
    return body.edges(cq.selectors.NearestToPointSelector((10, -length / 2, 10))).fillet(RADIUS)


def list_outer(lost: Any, normals: tuple[tuple[float, float, float], ...] = ()) -> list[Base]:
    """The fillet, the planes beside it, and planes with one of the normals, under stock."""
    wanted = [np.array(each) for each in ((0, 0, 1), (1, 0, 0), *normals)]
    bases = []
    for k, face in enumerate(lost.val().Solids()[0].Faces()):
        normal = np.array(face.normalAt().toTuple())
        beside = max(abs(face.Center().x - 10), abs(face.Center().z - 10)) > 3
        end = any(abs(normal @ each - 1) < 1e-9 for each in wanted[2:])
        plane = any(abs(normal @ each - 1) < 1e-9 for each in wanted[:2]) and beside and face.Center().x > 10 - 1e-6
        if face.geomType() == "CYLINDER" or end or (plane and face.Center().z >= 10 - 1e-6):
            bases.append(Base(face.wrapped, k, HIGH))
    return bases


def measure(stock: list[Any]) -> float:
    assert all(cq.Shape.cast(solid).isValid() for solid in stock)
    return sum(measure_volume(solid) for solid in stock)


def test_stock_ends_at_the_axis_where_its_neighbours_go_on() -> None:
    lost = make_angle().intersect(cq.Workplane().box(20, 10, 20).translate((10, -20, 10)))
    bases = list_outer(lost)
    assert len(bases) == 3
    assert measure(build_stock(bases)) == pytest.approx(SECTION * 10, rel=1e-6)


@pytest.mark.slow
def test_at_a_straight_end_the_stock_goes_on_over_the_edges() -> None:
    lost = make_angle().intersect(cq.Workplane().box(20, 10, 20).translate((10, -2, 10)))  # 7 of it in the part
    bases = list_outer(lost, ((0, 1, 0),))
    assert len(bases) == 4
    (end,) = [base for base in bases if cq.Face(base.face).normalAt().y > 0.9]
    expected = SECTION * (7 + HIGH) + cq.Face(end.face).Area() * HIGH
    assert measure(build_stock(bases)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_sides_that_touch_at_the_axis_are_refused() -> None:
    """The end of the loss on the fillet goes along the axis and back."""
    bite = cq.Workplane().sphere(3).translate((11, -15, 11))
    lost = make_angle().intersect(cq.Workplane().box(20, 10, 20).translate((20, -20, 20)).cut(bite))
    (face,) = [each for each in explore_faces(lost.val().Solids()[0].wrapped) if is_narrow(each, HIGH)]
    with pytest.raises(StockError, match="touch one another at the axis"):
        build_wedge(face)


@pytest.mark.slow
def test_an_end_at_a_slant_is_refused() -> None:
    cutter = cq.Workplane().box(100, 60, 200).rotate((0, 0, 0), (1, 0, 0), 30).translate((10, 31, 10))
    lost = make_angle().cut(cutter).intersect(cq.Workplane().box(20, 30, 20).translate((10, -10, 10)))
    bases = list_outer(lost, ((0, np.cos(np.pi / 6), np.sin(np.pi / 6)), (0, np.cos(np.pi / 6), -np.sin(np.pi / 6))))
    assert len(bases) == 4
    with pytest.raises(StockError, match=r"slant|folds"):
        build_stock(bases)


@pytest.mark.slow
@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    place=st.tuples(*[st.floats(-2, 2)] * 3), size=st.floats(5, 9), turn=st.floats(0, 90), ball=st.booleans()
)  # fmt: skip
def test_a_wedge_has_half_the_area_times_the_radius(
    place: tuple[float, float, float], size: float, turn: float, ball: bool
) -> None:
    """Whatever outline the damage has on the fillet."""
    tool = cq.Workplane().sphere(size) if ball else cq.Workplane().box(size, size, 4 * size)
    tool = tool.rotate((0, 0, 0), (1, 2, 0), turn).translate((10 + place[0], -20 + place[1], 10 + place[2]))
    for solid in make_angle().intersect(tool).val().Solids():
        for face in explore_faces(solid.wrapped):
            assert not is_narrow(face, RADIUS - 0.01)
            if not is_narrow(face, HIGH):
                continue
            try:
                made = measure_volume(build_wedge(face))
            except StockError:
                continue  # said, and the deposit has facets
            assert made == pytest.approx(cq.Face(face).Area() * RADIUS / 2, rel=2e-5)


@pytest.mark.slow
def test_a_deposit_over_a_fillet_is_exact(tmp_path: Path) -> None:
    """A loss from end to end: where it ends on the fillet, the stock's sides touch along the axis."""
    cq.exporters.export(make_angle(12), str(tmp_path / "angle.step"))
    tool = {"tool": "box", "centre": [13, -6, 13], "size": [14, 20, 18], "rotation": [0, 45, 0]}
    job = {
        "version": 1, "units": "mm", "tolerance": 0.3, "part": str(tmp_path / "angle.step"), "align": "none",
        "scan": {"use": "simulate", "points": 40000, "noise": 0.05, "seed": 4, "damage": [tool]},
        "accept": "all", "allowance": {"use": "milling", "outer": HIGH}, "export": {"format": ["step"]},
        "report": "none",
    }  # fmt: skip
    result = damageest.run(job, output=tmp_path / "out")
    (said,) = json.loads((tmp_path / "out/result.json").read_text())["sites"]
    deposit = said["exact"]["deposit"]
    assert deposit["reason"] == ""
    (solid,) = cq.importers.importStep(str(tmp_path / "out/deposit/site-1.step")).solids().vals()
    assert solid.isValid()
    stock = deposit["volume"] - said["exact"]["volume"]
    mesh = result.sites[0].deposit
    assert mesh is not None
    assert stock == pytest.approx(mesh.volume - result.sites[0].damage.volume, rel=0.06)  # that is higher
