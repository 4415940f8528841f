"""Deposits whose stock is the offset of the CAD's own faces: heights, volumes, and what is said where there is none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_cadquery.cutting.exact_damage import start_solids
from damageest_cadquery.reading.list_faces import list_faces
from damageest_cadquery.reading.read import read
from damageest_cadquery.solids.joining import StockError, explore_faces
from damageest_cadquery.solids.split import Piece, find_corners, measure_volume
from damageest_cadquery.stock.deposit import find_deposit
from damageest_cadquery.stock.offset_faces import Base, build_parts, build_stock, take_bases

import damageest
from damageest.artefacts import Deposit
from damageest.result import Result
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

HIGH = 0.5
BALL: dict[str, Any] = {"tool": "sphere", "centre": [2, 3, 6], "radius": 4}
CHIP = {"tool": "box", "centre": [15, 0, 6], "size": [8, 5, 6]}


def make_stock(shape: Any, is_outer: Callable[[Any], bool], height: float = HIGH) -> list[Any]:
    """Stock on those faces of a damage volume that are the part's."""
    faces = shape.val().Solids()[0].Faces()
    return build_stock([Base(face.wrapped, k, height) for k, face in enumerate(faces) if is_outer(face)])


def sum_volumes(solids: list[Any]) -> float:
    assert all(cq.Shape.cast(solid).isValid() for solid in solids)
    return sum(measure_volume(solid) for solid in solids)


def of_kind(*kinds: str) -> Callable[[Any], bool]:
    return lambda face: face.geomType() in kinds


def test_a_pit_in_a_plane_gets_a_cylinder_of_stock() -> None:
    lost = cq.Workplane().box(30, 20, 12).intersect(cq.Workplane().sphere(5).translate((2, 1, 6)))
    (stock,) = make_stock(lost, lambda face: face.geomType() == "PLANE")
    assert measure_volume(stock) == pytest.approx(np.pi * 25 * HIGH, rel=1e-9)
    assert sorted(cq.Face(face).geomType() for face in explore_faces(stock)) == ["CYLINDER", "PLANE", "PLANE"]
    assert find_corners(stock)[:, 2].max() == pytest.approx(6 + HIGH, abs=1e-9)


@pytest.mark.parametrize(("hollow", "outer"), [(False, 10 + HIGH), (True, 6 - HIGH)])
def test_stock_on_a_shaft_and_in_a_bore_is_a_cylinder(hollow: bool, outer: float) -> None:
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    if hollow:
        part, at = cq.Workplane().box(30, 30, 12).faces(">Z").workplane().hole(12), (6, 0, 0)
    else:
        part, at = cq.Workplane().cylinder(20, 10), (10, 0, 0)
    lost = part.intersect(cq.Workplane().sphere(4).translate(at))
    (stock,) = make_stock(lost, of_kind("CYLINDER"))
    area = sum(face.Area() for face in lost.val().Solids()[0].Faces() if face.geomType() == "CYLINDER")
    inner = 6 if hollow else 10
    assert sum_volumes([stock]) == pytest.approx(area * abs(outer**2 - inner**2) / (2 * inner), rel=1e-5)
    radii = [
        BRepAdaptor_Surface(face).Cylinder().Radius()
        for face in explore_faces(stock)
        if cq.Face(face).geomType() == "CYLINDER"
    ]
    assert {round(value, 9) for value in radii} == {min(inner, outer), max(inner, outer)}


def test_stock_on_a_ball_is_a_sphere() -> None:
    lost = cq.Workplane().sphere(13).intersect(cq.Workplane().box(8, 8, 8).translate((13, 0, 0)))
    stock = make_stock(lost, of_kind("SPHERE"))
    area = sum(face.Area() for face in lost.val().Solids()[0].Faces() if face.geomType() == "SPHERE")
    assert sum_volumes(stock) == pytest.approx(area * ((13 + HIGH) ** 3 - 13**3) / 3 / 13**2, rel=1e-5)


def test_edges_have_mitres_and_corners_are_filled() -> None:
    stock = make_stock(cq.Workplane().box(6, 5, 4), lambda face: face.normalAt().dot(cq.Vector(1, 1, 1)) > 0.5)
    faces, mitres = (30 + 20 + 24) * HIGH, (6 + 5 + 4) * HIGH**2
    assert len(stock) == 1
    assert faces + mitres < sum_volumes(stock) < faces + mitres + HIGH**3
    assert find_corners(stock[0]).max(axis=0) == pytest.approx(np.array([6, 5, 4]) / 2 + HIGH, abs=1e-9)


def test_the_end_of_a_shaft_has_a_round_mitre() -> None:
    lost = cq.Workplane().cylinder(20, 10).intersect(cq.Workplane().box(30, 30, 4).translate((0, 0, 10)))
    (stock,) = make_stock(lost, lambda face: face.Center().z > 8.5)
    assert sum_volumes([stock]) == pytest.approx(np.pi * ((10 + HIGH) ** 2 * (2 + HIGH) - 10**2 * 2), rel=1e-6)


def test_in_a_concave_corner_the_stock_of_both_sides_meets() -> None:
    outline = [(0, 0), (60, 0), (60, 10), (10, 10), (10, 50), (0, 50)]
    part = cq.Workplane("XZ").polyline(outline).close().extrude(40)
    lost = part.intersect(cq.Workplane().box(8, 10, 8).translate((10, -20, 10)))
    stock = make_stock(lost, lambda face: {round(face.Center().x, 6), round(face.Center().z, 6)} == {10, 12})
    assert sum_volumes(stock) == pytest.approx((4 * 10 + 4 * 10) * HIGH - 10 * HIGH**2, rel=1e-6)


def test_stock_that_would_fold_is_refused() -> None:
    lost = (
        cq.Workplane()
        .box(30, 30, 12)
        .faces(">Z")
        .workplane()
        .hole(12)
        .intersect(cq.Workplane().sphere(4).translate((6, 0, 0)))
    )
    with pytest.raises(StockError):
        make_stock(lost, of_kind("CYLINDER"), 7.0)


def test_stock_on_a_cone_beyond_its_apex_lies_outside() -> None:
    """Files have such faces: a countersink whose angle counts from the other side of the apex."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Ax3, gp_Cone, gp_Dir, gp_Pnt

    cone = gp_Cone(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), np.radians(45), 7.5)
    for low, high in ((2.0, 6.0), (-21.0, -17.0)):
        face = BRepBuilderAPI_MakeFace(cone, 0.0, 1.5, low, high).Face()
        normal = np.array(cq.Face(face).normalAt(cq.Face(face).Center()).toTuple())
        (stock,) = build_stock([Base(face, 0, HIGH)])
        rise = np.array(cq.Shape.cast(stock).Center().toTuple()) - np.array(cq.Face(face).Center().toTuple())
        assert normal @ rise == pytest.approx(HIGH / 2, rel=0.2)
        assert any(cq.Face(each).geomType() == "CONE" for each in explore_faces(stock))


def test_mitres_that_share_a_corner_but_for_rounding_errors_are_filled() -> None:
    from damageest_cadquery.stock.offset_faces import merge_points

    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1 + 1e-9], [1, 1e-9, 0]], float)
    assert merge_points(corners, 1e-4).tolist() == corners[:4].tolist()


def test_a_wall_between_arcs_is_a_cone_and_between_lines_a_plane() -> None:
    lost = cq.Workplane().cylinder(20, 10).intersect(cq.Workplane().box(6, 6, 6).translate((10, 0, 0)))
    (stock,) = make_stock(lost, of_kind("CYLINDER"))
    kinds = sorted(cq.Face(face).geomType() for face in explore_faces(stock))
    assert kinds == ["CYLINDER", "CYLINDER", "PLANE", "PLANE", "PLANE", "PLANE"]


@dataclass(frozen=True)
class Run:
    result: Result
    folder: Path
    said: list[dict[str, Any]]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A pit and a chip over an edge, with stock on the top only."""
    place = tmp_path_factory.mktemp("deposit")
    cq.exporters.export(cq.Workplane().box(30, 20, 12), str(place / "block.step"))
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2, "part": str(place / "block.step"), "align": "none",
        "scan": {"use": "simulate", "points": 25000, "noise": 0.04, "seed": 4, "damage": [BALL, CHIP]},
        "allowance": {"use": "milling", "outer": HIGH}, "export": {"format": ["step"]}, "report": "none",
    }  # fmt: skip
    result = damageest.run(job, output=place / "out")
    said = json.loads((place / "out/result.json").read_text())["sites"]
    return Run(result, place / "out", said)


@pytest.mark.slow
def test_deposits_are_written_with_offset_faces(done: Run) -> None:
    for site, said in zip(done.result.sites, done.said, strict=True):
        exact = said["exact"]["deposit"]
        assert exact["reason"] == ""
        (solid,) = cq.importers.importStep(str(done.folder / f"deposit/site-{site.id}.step")).solids().vals()
        assert solid.isValid()
        assert measure_volume(solid.wrapped) == pytest.approx(exact["volume"], rel=1e-6)
        assert solid.BoundingBox().zmax == pytest.approx(6 + HIGH, abs=1e-6)
        assert site.deposit is not None
        assert site.deposit.volume == pytest.approx(exact["volume"], rel=0.015), "both are as high as asked"
        assert exact["distance"] <= done.result.tolerance / 4
        assert len(solid.Faces()) == exact["faces"] < 20
    stock = done.said[0]["exact"]["deposit"]["volume"] - done.said[0]["exact"]["volume"]
    assert stock == pytest.approx(np.pi * BALL["radius"] ** 2 * HIGH, rel=0.01), "on the pit as it truly is"
    text = (done.folder / "result.step").read_text()
    assert "PRODUCT('deposit site-1'" in text


@pytest.mark.slow
def test_faces_of_deposits_have_names(done: Run) -> None:
    listed = list_faces(read(done.folder / "deposit/site-1.step", ".step"), 1.0)
    names = [face.name for face in listed]
    tops = [face for face in listed if face.name.startswith("stock on face ")]
    assert len(tops) == done.said[0]["exact"]["deposit"]["offsets"] >= 1
    assert any(name.startswith("damage site-1 inner") for name in names)
    assert "side of the stock" in names
    assert any(face.normal == pytest.approx((0, 0, 1)) and face.centre[2] == pytest.approx(6 + HIGH) for face in tops)


@pytest.mark.slow
def test_as_cadquery_gives_the_deposit(done: Run) -> None:
    shape = done.result.as_cadquery("deposit", 1)
    assert measure_volume(shape.wrapped) == pytest.approx(done.said[0]["exact"]["deposit"]["volume"], rel=1e-6)
    without = replace(done.result, sites=tuple(replace(site, deposit=None) for site in done.result.sites))
    lost = without.as_cadquery("deposit", 1)
    assert measure_volume(lost.wrapped) == pytest.approx(done.said[0]["exact"]["volume"], rel=1e-6)


def take_damage() -> tuple[Any, Any]:
    """A part's face pieces as they come out of a split, and its faces."""
    return start_solids([cq.Workplane().box(30, 20, 12).val().wrapped])


@pytest.mark.slow
def test_what_cannot_be_an_offset_is_said(done: Run) -> None:
    pieces, faces = take_damage()
    with pytest.raises(StockError, match="not the same all over") as caught:
        take_bases(pieces[0], {2: -1.0})
    assert caught.value.describe(["face 0", "face 1", "Top"]).startswith("stock on face 2 (Top): its height")
    deposit = done.result.sites[0].deposit
    assert isinstance(deposit, Deposit)
    with pytest.raises(StockError, match="overlaps the intact skin"):
        find_deposit(replace(deposit, overlap=1.0), deposit, pieces, (), faces, done.result.part, 0.2)
    with pytest.raises(StockError, match="does not say how high"):
        find_deposit(replace(deposit, heights=()), deposit, pieces, (), faces, done.result.part, 0.2)


@pytest.mark.slow
def test_stock_of_another_volume_is_refused(done: Run) -> None:
    """Stock on the whole top, where the mesh has it over a pit."""
    pieces, faces = take_damage()
    deposit = done.result.sites[0].deposit
    assert isinstance(deposit, Deposit)
    with pytest.raises(StockError, match="from the mesh's") as caught:
        find_deposit(deposit, done.result.sites[0].damage, pieces, (), faces, done.result.part, 0.2)
    assert caught.value.faces


def take_pit(radius: float, top: int, place: tuple[float, float] = (2, 3)) -> Piece:
    """An exact pit at a ``place`` of the CAD face ``top``, which its flat face is a piece of."""
    lost = cq.Workplane().box(30, 20, 12).intersect(cq.Workplane().sphere(radius).translate((*place, 6)))
    solid = lost.val().Solids()[0].wrapped
    flat = [cq.Face(face).Center().z > 5.99 for face in explore_faces(solid)]
    return Piece(solid, 0, tuple((top, -1) if each else (-1, 0) for each in flat))


@pytest.mark.slow
def test_stock_on_another_outline_is_compared_on_its_own_skin(done: Run) -> None:
    """The exact pit is wider by two tolerances, as where the mesh does not show how a loss fades out."""
    from damageest_cadquery.stock._compare import compare_stock

    site, part = done.result.sites[0], done.result.part
    deposit = site.deposit
    assert isinstance(deposit, Deposit)
    ((top, high),) = deposit.heights
    piece = take_pit(BALL["radius"] + 0.4, top)

    def compare(height: float, to: Deposit = deposit) -> tuple[float, float, float]:
        bases = take_bases(piece, {top: height})
        return compare_stock([piece], bases, build_parts(bases), to, site.damage, part, 0.2)

    _, farthest, difference = compare(high)
    assert farthest > 0.3, "the mesh ends elsewhere"
    assert 0.01 < difference < 0.05
    with pytest.raises(StockError, match=r"mesh's|differs"):
        compare(high + 0.07)
    # something took a part of the mesh's stock away: on the exact one it would be there
    with pytest.raises(StockError, match=r"mesh's|differs"):
        compare(high, replace(deposit, stock_volume=0.98 * deposit.stock_volume))


@pytest.mark.slow
def test_a_small_body_of_the_damage_may_carry_stock(done: Run) -> None:
    """As its own piece, though it is more than a thousandth of the deposit; a larger one is refused."""
    site, part = done.result.sites[0], done.result.part
    deposit = site.deposit
    assert isinstance(deposit, Deposit)
    ((top, _),) = deposit.heights
    _, faces = take_damage()

    def find(radius: float) -> list[float]:
        damage = [take_pit(BALL["radius"], top), take_pit(radius, top, (8, 3))]
        found = find_deposit(deposit, site.damage, damage, (), faces, part, 0.2)
        return [measure_volume(piece.shape) for piece in found.pieces]

    least = 1e-3 * deposit.volume
    volumes = find(0.35)
    assert len(volumes) == 2
    assert min(volumes) == pytest.approx(np.pi * 0.35**2 * (HIGH + 2 / 3 * 0.35), rel=1e-4)
    assert min(volumes) > least
    with pytest.raises(StockError, match="2 solids for 1 pieces"):
        find(0.45)
