"""Targets, regions to keep free, overlap, cut-back and bad options of `allowance: milling`, against known figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold
from pydantic import ValidationError

from damageest.artefacts import Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import to_manifold
from damageest.io.meshes import write_stl
from damageest.stages.allowance._stock import LIFT
from damageest.stages.allowance.milling import Milling
from tests.stages.allowance.shapes import (
    INSET,
    TOLERANCE,
    block,
    bored,
    bracket,
    deposit_on,
    nearest,
    part_of,
    solid_of,
)

MORE = LIFT * TOLERANCE / 2
"""How much higher the stock is than asked for, so that it is nowhere lower."""
CHIP = Manifold.cube((6, 5, 4)).translate((0, 0, 8))
"""At a corner of the block: 6 along x, 5 along y, 4 down from the top."""


def test_stock_on_a_round_has_the_volume_of_its_offset() -> None:
    """As the STEP file has it: the mesh's stock was a quarter of the tolerance higher, 3 % of this one."""
    radius, high, depth, length = 12.0, 0.8, 3.0, 20.0
    bar = Manifold.cylinder(40, radius, radius, 180)
    segment = bar ^ Manifold.cube((10, 40, length)).translate((radius - depth, -20, 10))
    deposit = deposit_on(bar, segment, outer=high)
    half = np.arccos(1 - depth / radius)
    assert deposit.stock_volume == pytest.approx(half * ((radius + high) ** 2 - radius**2) * length, rel=1e-3)


def extent(deposit: Solid) -> list[float]:
    """The bounds in one list: lowest corner, then highest."""
    return [*deposit.bounds[0].tolist(), *deposit.bounds[1].tolist()]


@pytest.mark.parametrize(
    ("direction", "expected"),
    [
        ((0, 0, 1), [0, 0, 8, 6, 5, 12 + 1 + MORE]),
        ((0, 0, -1), [0, 0, 8, 6, 5, 12]),
        ((-1, 0, 0), [-1 - MORE, 0, 8, 6, 5, 12]),
    ],
)
def test_stock_only_on_skin_that_faces_a_direction(direction: tuple[int, int, int], expected: list[float]) -> None:
    deposit = deposit_on(block(), CHIP, targets=[{"facing": {"direction": direction}, "outer": 1}])
    assert extent(deposit) == pytest.approx(expected)
    area = {12 + 1 + MORE: 30.0, 12: 0.0}.get(expected[5], 0.0) or (20.0 if expected[0] < 0 else 0.0)
    assert deposit.stock_volume == pytest.approx(area * (1 + MORE), rel=INSET, abs=1e-6)


def test_the_first_target_that_matches_is_used() -> None:
    top = {"direction": (0, 0, 1)}
    targets = [{"facing": top, "outer": 0.4}, {"facing": top, "outer": 2}, {"facing": top, "outer": 0}]
    deposit = deposit_on(block(), CHIP, targets=targets)
    assert deposit.stock_volume == pytest.approx(30 * (0.4 + MORE), rel=INSET)
    assert deposit.thickness == pytest.approx((0.4 + MORE,) * 3)


@pytest.mark.parametrize(
    "where",
    [
        {"box": [[-5, -5, 11], [2, 20, 14]]},
        {"half_space": {"point": [2, 0, 0], "normal": [-3, 0, 0]}, "facing": {"direction": [0, 0, 1]}},
    ],
)
def test_skin_is_cut_where_a_target_ends(where: dict[str, Any]) -> None:
    deposit = deposit_on(block(), CHIP, targets=[{"facing": {"direction": [0, 0, 1]}, **where, "outer": 1}])
    assert deposit.stock_volume == pytest.approx(2 * 5 * (1 + MORE), rel=INSET)


def test_two_heights_beside_one_another() -> None:
    deposit = deposit_on(
        block(), CHIP,
        targets=[
            {"facing": {"direction": [0, 0, 1]}, "half_space": {"point": [4, 0, 0], "normal": [1, 0, 0]}, "outer": 2},
            {"facing": {"direction": [0, 0, 1]}, "outer": 0.5},
        ],
    )  # fmt: skip
    assert deposit.stock_volume == pytest.approx(2 * 5 * (2 + MORE) + 4 * 5 * (0.5 + MORE), rel=INSET)


def test_stock_on_edges_and_corner() -> None:
    deposit = deposit_on(block(), CHIP, outer=1)
    high = 1 + MORE
    assert extent(deposit) == pytest.approx([-high, -high, 8, 6, 5, 12 + high])
    faces = (30 + 20 + 24) * high
    mitres = (6 + 5 + 4) * high**2
    assert faces + mitres < deposit.stock_volume < faces + mitres + high**3
    corner = np.array([[0, 0, 12.0]])
    assert nearest(corner, deposit)[0] >= 1


@pytest.mark.parametrize(
    ("item", "reached"),
    [
        ({"box": [[-9, -9, 12], [3, 9, 20]]}, 15 * (1 + MORE)),
        ({"cylinder": {"from": [3, 2.5, 12], "to": [3, 2.5, 20], "radius": 1}}, (30 - np.pi) * (1 + MORE)),
        ({"half_space": {"point": [3, 0, 0], "normal": [-1, 0, 0]}}, 15 * (1 + MORE)),
        ({"facing": {"direction": [0, 0, 1]}}, 0),
    ],
)
def test_what_is_kept_free(item: dict[str, Any], reached: float) -> None:
    deposit = deposit_on(block(), CHIP, targets=[{"facing": {"direction": [0, 0, 1]}, "outer": 1}], keep_out=[item])
    assert deposit.stock_volume == pytest.approx(reached, rel=2e-3, abs=1e-6)


def test_no_stock_covers_skin_kept_free() -> None:
    """The wall's stock in a concave corner ends above the floor that is kept free."""
    tool = Manifold.cube((6, 5, 6), True).translate((6, 10, 6))
    both = deposit_on(bracket(), tool, outer=1)
    free = deposit_on(bracket(), tool, outer=1, keep_out=[{"facing": {"direction": [0, 0, 1]}}])
    floor = Manifold.cube((3, 5, 1)).translate((6, 7.5, 6))
    assert (to_manifold(both) ^ floor).volume() == pytest.approx(3 * 5, rel=INSET)
    assert (to_manifold(free) ^ floor).volume() < 1e-6


def test_a_mesh_to_keep_free(tmp_path: Path) -> None:
    body = solid_of(Manifold.cube((3, 9, 9)).translate((-0.0, 0, 12)))
    write_stl(tmp_path / "pad.stl", body)
    target = {"facing": {"direction": [0, 0, 1]}, "outer": 1}
    deposit = deposit_on(block(), CHIP, targets=[target], keep_out=[{"mesh": tmp_path / "pad.stl"}])
    assert deposit.stock_volume == pytest.approx(15 * (1 + MORE), rel=INSET)


def test_a_damage_in_a_solid_to_keep_free_is_refused() -> None:
    with pytest.raises(StageError, match=r"50.0% of the damage volume, 60, lies in keep_out 1") as caught:
        deposit_on(block(), CHIP, outer=1, keep_out=[{"box": [[-1, -1, 0], [3, 9, 20]]}])
    assert "smaller solid" in caught.value.remedy


def test_overlap_covers_the_intact_skin_around_the_rim() -> None:
    tool = Manifold.cube((8, 8, 4)).translate((10, 6, 10))
    deposit = deposit_on(block(), tool, outer=1, overlap=1.5)
    reach = 8 * 8 + 4 * 8 * 1.5 + np.pi * 1.5**2
    assert deposit.stock_volume / (1 + MORE) == pytest.approx(reach, rel=0.01)
    low, high = deposit.bounds
    assert (low[:2] > np.array([8.5, 4.5]) - 1e-6).all()
    assert low[:2] == pytest.approx([8.5, 4.5], abs=TOLERANCE)
    assert high[2] == pytest.approx(13 + MORE)


def test_overlap_stays_on_its_side_of_a_thin_wall() -> None:
    plate = Manifold.cube((20, 20, 1))
    tool = Manifold.cube((4, 4, 1)).translate((8, 8, 0.5))
    deposit = deposit_on(plate, tool, outer=0.5, overlap=3)
    assert deposit.bounds[0][2] == pytest.approx(0.5)


@pytest.mark.slow
def test_cut_back_removes_intact_metal_up_to_inner() -> None:
    tool = Manifold.sphere(4, 64).translate((15, 10, 12))
    body, inner = block(), 0.6
    lost = solid_of(body ^ tool)
    deposit = deposit_on(body, tool, outer=1, inner=inner)
    assert deposit.cavity is not None
    least = (Manifold.sphere(4 + inner, 128).translate((15, 10, 12)) ^ body).volume()
    most = (Manifold.sphere(4 + inner + TOLERANCE / 2, 128).translate((15, 10, 12)) ^ body).volume()
    assert least * 0.995 < deposit.cavity.volume < most
    assert deposit.cut_back_volume == pytest.approx(deposit.cavity.volume - lost.volume)
    assert (to_manifold(lost) - to_manifold(deposit.cavity)).volume() < 1e-6
    points = deposit.cavity.vertices[nearest(deposit.cavity.vertices, part_of(body))[0] > 1e-3]
    far = np.linalg.norm(points - [15, 10, 12], axis=1) - 4
    assert far.min() > inner - 0.02
    assert far.max() < inner + TOLERANCE / 2


@pytest.mark.slow
def test_a_deep_cut_back_of_a_pocket_has_the_volume_of_the_offset() -> None:
    """Thirty tolerances deep, round an L, whose inner corner gives the offset a crease."""
    inner, depth, block_ = 3.0, 2.0, Manifold.cube((60, 60, 20))
    arms = Manifold.cube((14, 6, depth)) + Manifold.cube((6, 14, depth))
    deposit = deposit_on(block_, arms.translate((22, 22, 20 - depth)), outer=0, inner=inner)
    assert deposit.cavity is not None

    def offset(reach: float) -> float:
        """Floor, walls, four rounded edges of the floor less what counts twice at the inner corner, and the rest."""
        area, round_ = 14 * 6 + 6 * 8, np.pi * reach**2 / 4
        floor = area * reach
        walls = (14 + 6 + 8 + 8 + 6 + 14) * depth * reach + 5 * round_ * depth - reach**2 * depth
        edges = (14 + 6 + 8 + 8 + 6 + 14) * round_ + 5 * np.pi * reach**3 / 6
        return float(area * depth + floor + walls + edges - reach**3 * 2 / 3)

    assert offset(inner) <= deposit.cavity.volume <= offset(inner + TOLERANCE / 2)
    points = deposit.cavity.vertices[deposit.cavity.vertices[:, 2] < 20 - 1e-6]
    away = nearest(points, solid_of(arms.translate((22, 22, 20 - depth))))[0]
    assert inner <= away.min() <= away.max() <= inner + TOLERANCE / 2


def test_cut_back_leaves_out_the_other_damages() -> None:
    other = solid_of(Manifold.cube((3, 3, 3)).translate((16.2, 8, 9)))
    tool = Manifold.cube((4, 4, 3)).translate((12, 8, 9))
    deposit = deposit_on(block(), tool, others=other, inner=0.5)
    assert deposit.cavity is not None
    assert (to_manifold(deposit.cavity) ^ to_manifold(other)).volume() < 1e-6


def named(body: Any) -> Part:
    """A part with CAD faces by their normal: 0 to 5 for -x, +x, -y, +y, -z, +z; 6 for the rest, a cylinder."""
    part = part_of(body)
    normal = part.cross / np.linalg.norm(part.cross, axis=1)[:, None]
    axes = np.repeat(np.eye(3), 2, axis=0) * np.tile([-1, 1], 3)[:, None]
    close = normal @ axes.T > 0.9999
    number = np.where(close.any(axis=1), close.argmax(axis=1), 6)
    names = ("left", "right", "front", "back", "bottom", "top", "bore")
    kinds = ("plane",) * 6 + ("cylinder",)
    return Part(part.vertices, part.faces, faces_brep=number, face_names=names, face_kinds=kinds)


@pytest.mark.parametrize("where", [{"faces": [5]}, {"faces": ["top"]}, {"faces": ["top", 5]}])
def test_cad_faces_by_number_and_name(where: dict[str, Any]) -> None:
    deposit = deposit_on(block(), CHIP, part=named(block()), targets=[{**where, "outer": 1}])
    assert deposit.stock_volume == pytest.approx(30 * (1 + MORE), rel=INSET)
    assert deposit.touched == (5,)


def test_heights_of_cad_faces() -> None:
    deposit = deposit_on(block(), CHIP, part=named(block()), outer=0.5, targets=[{"faces": [5], "outer": 1}])
    heights = dict(deposit.heights)
    assert heights.pop(5) == 1
    assert set(heights.values()) == {0.5}
    assert len(heights) == 2
    half = {"half_space": {"point": [3, 0, 0], "normal": [-1, 0, 0]}, "outer": 1}
    assert dict(deposit_on(block(), CHIP, part=named(block()), targets=[half]).heights)[5] == -1
    assert deposit_on(block(), CHIP, part=named(block()), outer=1, overlap=0.5).overlap == 0.5


def test_kinds_of_surface() -> None:
    tool = Manifold.cube((6, 6, 4)).translate((18, 7, 9))
    deposit = deposit_on(bored(), tool, part=named(bored()), targets=[{"kind": "cylinder", "outer": 0.5}])
    assert 6 in deposit.touched
    assert 5 not in deposit.touched
    assert deposit.bounds[1][2] == pytest.approx(12)


@pytest.mark.parametrize(
    ("part", "where", "message", "remedy"),
    [
        (named, {"faces": ["topp"]}, r"no CAD face 'topp' \(did you mean 'top'\?\)", "left, right, front, back"),
        (named, {"faces": [7]}, "no CAD face 7", "from 0 to 6"),
        (part_of, {"faces": [1]}, "'faces' selects CAD faces, but the part is a mesh", "STEP, IGES or BREP"),
        (part_of, {"kind": "plane"}, "'kind' selects CAD faces, but the part is a mesh", "STEP, IGES or BREP"),
    ],
)
def test_faces_that_do_not_exist(part: Any, where: dict[str, Any], message: str, remedy: str) -> None:
    with pytest.raises(StageError, match=message) as caught:
        deposit_on(block(), CHIP, part=part(block()), targets=[{**where, "outer": 1}])
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        (
            {"targets": [{"boxx": 1, "outer": 1}]},
            r"unknown key 'boxx' \(did you mean 'box'\?\); valid are: box, half_space",
        ),
        ({"targets": [{"outer": 1}]}, "selects no skin; give one or more of: box, half_space, facing, faces, at, kind"),
        ({"targets": [{"box": [[1, 0, 0], [0, 1, 1]], "outer": 1}]}, "the lowest corner first"),
        ({"targets": [{"facing": {"direction": [0, 0, 0]}, "outer": 1}]}, "a direction must have a length"),
        ({"keep_out": [{"box": [[0, 0, 0], [1, 1, 1]], "mesh": "a.stl"}]}, "give one of: cylinder; mesh"),
        ({"keep_out": [{"cylinder": {"from": [0, 0, 0], "to": [0, 0, 0], "radius": 1}}]}, "give two different points"),
        ({"outer": -1}, "greater than or equal to 0"),
        ({"interference": "maybe"}, "'refuse' or 'clip'"),
    ],
)
def test_options_that_are_wrong(chosen: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Milling.model_validate(chosen)


def test_no_stock_at_all_is_noted() -> None:
    deposit = deposit_on(block(), CHIP)
    assert deposit.volume == pytest.approx(120)
    assert deposit.thickness is None
    assert "no stock on the skin" in deposit.notes[0]


def test_stock_without_any_room_says_so() -> None:
    top = {"targets": [{"facing": {"direction": [0, 0, 1]}, "outer": 1}]}
    deposit = deposit_on(block(), CHIP, **top, keep_out=[{"box": [[-9, -9, 12], [99, 99, 99]]}])
    assert deposit.stock_volume == pytest.approx(0, abs=1e-6)
    assert deposit.thickness == (0, 0, 0)
    assert deposit.notes == ("no room for any stock: keep_out or metal is in the way; make keep_out smaller",)
