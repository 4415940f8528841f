"""A cavity that is opened before deposition: what it holds, and that a cutter reaches all of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Deposit, Part, Solid
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_manifold, to_solid
from damageest.stages.allowance import _booleans
from damageest.stages.allowance._booleans import drop_crumbs
from damageest.stages.allowance._prepare import open_cavity
from damageest.stages.allowance.milling import Milling

TOLERANCE = 0.25
BLOCK = Manifold.cube((60, 40, 20)).translate((-30, -20, -20))


def as_solid(body: Any) -> Solid:
    found = to_solid(body)
    assert found is not None
    return found


def prepare(tool: Any, body: Any = BLOCK, tolerance: float = TOLERANCE, **options: Any) -> tuple[Any, Any, Deposit]:
    """The damage that a tool leaves in the body, the cavity that is made of it, and the deposit."""
    block, damage = as_solid(body), as_solid(body ^ tool)
    part = Part(block.vertices, block.faces)
    made = Milling(prepare=options).run(damage=damage, part=part, tolerance=tolerance, others=None)
    assert isinstance(made, Deposit)
    return to_manifold(damage), to_manifold(made.cavity or damage), made


def measure_area(body: Any, height: float) -> float:
    return float(body.slice(height).area())


@pytest.mark.slow
def test_an_undercut_is_removed_and_nothing_else() -> None:
    ball = Manifold.sphere(6, 128).translate((0, 0, -4))
    lost, cavity, made = prepare(ball, tolerance=0.22, wall_angle=0)
    assert (lost - cavity).volume() < 1e-5 * lost.volume()
    # straight up from the widest place, 4 below the top
    for height in (-3.0, -1.0, -0.2):
        assert measure_area(cavity, height) == pytest.approx(np.pi * 36, rel=0.08)  # a cell of the grid
    assert measure_area(cavity, -8.0) == pytest.approx(measure_area(lost, -8.0), rel=0.08)
    assert made.milled is not None
    assert made.milled.volume == pytest.approx(cavity.volume() - lost.volume(), rel=1e-3)
    assert made.cut_back_volume == pytest.approx(made.milled.volume, rel=1e-3)
    assert made.volume == pytest.approx(cavity.volume(), rel=1e-4)


@pytest.mark.variants(1)
@pytest.mark.parametrize("angle", [15.0, 40.0])
def test_walls_lean_outward_by_the_angle(angle: float) -> None:
    _, cavity, _ = prepare(Manifold.cube((16, 12, 12), True), wall_angle=angle)
    out = 3.0 * np.tan(np.radians(angle))
    low, high = np.array(cavity.slice(-5.5).bounds()), np.array(cavity.slice(-2.5).bounds())
    assert np.abs(high - low) == pytest.approx(out, abs=0.4)


def test_a_crack_becomes_as_wide_as_the_cutter() -> None:
    crack = Manifold.cube((20, 0.4, 12), True)
    lost, cavity, _ = prepare(crack, min_radius=2.0, wall_angle=0)
    wide = cavity.slice(-3.0).bounds()
    assert wide[3] - wide[1] == pytest.approx(4.4, abs=0.6)
    assert (lost - cavity).volume() < 1e-5 * lost.volume()


@pytest.mark.slow
def test_depth_is_added_below() -> None:
    _, cavity, _ = prepare(Manifold.cube((16, 12, 12), True), wall_angle=0, depth=1.5)
    assert cavity.bounding_box()[2] == pytest.approx(-7.5, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("height", "is_removed"), [(3.0, True), (30.0, False)])
def test_a_shoulder_over_the_opening_is_removed_and_a_wall_stays(height: float, is_removed: bool) -> None:
    raised = BLOCK + Manifold.cube((24, 40, height + 1)).translate((6, -20, -1))
    lost, cavity, made = prepare(Manifold.cube((10, 12, 12), True), raised, wall_angle=30, direction=(0, 0, 1))
    if is_removed:
        over = [(cavity.translate((0, 0, up)) ^ (raised - cavity)).volume() for up in (0.5, 2.0, 4.0)]
        assert max(over) < 1e-4 * lost.volume()
        # the wall of the opening goes on at its angle up to the top of the shoulder
        assert cavity.slice(2.9).bounds()[2] == pytest.approx(5 + 8.9 * np.tan(np.radians(30)), abs=0.4)
    else:
        assert cavity.bounding_box()[5] < 0.1
    assert (lost - cavity).volume() < 1e-5 * lost.volume()
    assert made.cut_back_volume == pytest.approx(cavity.volume() - lost.volume(), rel=1e-3)


@pytest.mark.slow
def test_a_hole_through_the_part_asks_for_a_direction() -> None:
    hole = Manifold.cylinder(60, 5, 5, 48, True)
    with pytest.raises(StageError, match="no common direction"):
        prepare(hole)
    _, cavity, _ = prepare(hole, direction=(0.0, 0.0, 1.0), wall_angle=20)
    assert measure_area(cavity, -0.5) > measure_area(cavity, -19.5) > np.pi * 24


ROD = Manifold.cylinder(60, 10, 10, 96, True)
CHANNEL = Manifold.cube((60, 40, 20), True) - Manifold.cube((70, 30, 12), True).translate((0, 0, 6))


def make_lump(radius: float) -> Any:
    """A rough lump of some dozen facets."""
    points = np.random.default_rng(3).normal(size=(60, 3))
    points *= radius * np.linspace(0.85, 1.15, 60)[:, None] / np.linalg.norm(points, axis=1)[:, None]
    return Manifold.hull_points(points)


@pytest.mark.variants(1)
@pytest.mark.parametrize(("cutter", "tolerance"), [(1.5, TOLERANCE), pytest.param(0.3, 0.1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("body", "place", "radius"),
    [
        (ROD, (7, 4, 27), 6),
        (BLOCK, (29, 3, -2), 6),
        (BLOCK, (29, 18, -1), 4),
        pytest.param(CHANNEL, (5, 17, -3), 6, marks=pytest.mark.slow),
    ],
    ids=["rod", "edge", "corner", "channel"],
)
def test_what_the_cutter_opens_stands_out_of_the_part_all_round(
    body: Any, place: tuple[float, float, float], radius: float, cutter: float, tolerance: float
) -> None:
    """Else the cut that exact solids are made with would end on the skin, where a lump's corner meets it."""
    tool = make_lump(radius).translate(place)
    _, _, made = prepare(tool, body, tolerance, wall_angle=20, min_radius=cutter)
    damage, whole = as_solid(body ^ tool), as_solid(body)
    skin = damage.faces[~find_inner_faces(damage, Part(whole.vertices, whole.faces))]
    assert made.opening is not None
    depth = -signed_distance(damage.vertices[np.unique(skin)], made.opening)[0]
    assert depth.min() > 0.02 * tolerance


@pytest.mark.slow
def test_neither_cavity_nor_milled_metal_has_crumbs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dozen of 1e-5 mm3 and less were left beside the metal milled off a gear."""
    crumb = Manifold.cube((0.01, 0.01, 0.03), True).translate((25, 15, -0.02))

    def leave_crumb(*given: Any) -> tuple[Solid, Solid | None]:
        cavity, opening = open_cavity(*given)
        return as_solid(to_manifold(cavity) + crumb), opening

    monkeypatch.setattr("damageest.stages.allowance.milling.open_cavity", leave_crumb)
    _, cavity, made = prepare(Manifold.cube((16, 12, 12), True).translate((0, 0, 2)))
    assert made.milled is not None
    for body in (cavity, to_manifold(made.milled), to_manifold(made)):
        assert len(body.decompose()) == 1


def test_a_small_piece_and_a_small_void_are_crumbs() -> None:
    """Rounding errors of Boolean operations left closed bodies of a millionth of a cubic millimetre in it."""
    body = Manifold.cube((4, 4, 4), True)
    crumb = Manifold.cube((1e-3, 1e-3, 1e-3), True).translate((9, 0, 0))
    void = Manifold.cube((1e-3, 1e-3, 1e-3), True)
    crumbled, origin = as_solid(body - void + crumb), np.array([5.0, 1.0, 0.0])
    assert len(to_manifold(crumbled).decompose()) == 3
    cleaned = drop_crumbs(crumbled, origin, 1e-7 * body.volume())
    assert len(to_manifold(cleaned).decompose()) == 1
    assert cleaned.volume == pytest.approx(64)
    assert drop_crumbs(cleaned, origin, 1e-7) is cleaned


def test_a_deposit_has_no_crumbs_of_stock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such of stock that touched the cavity at a vertex kept a gear's deposit from having a STEP file."""
    crumb = Manifold.cube((0.01, 0.01, 0.01)).translate((8, 6, 0))
    keep = _booleans.keep_touching
    monkeypatch.setattr(_booleans, "keep_touching", lambda *given: keep(*given) + crumb)
    tool = Manifold.cube((16, 12, 12), True)
    block, damage = as_solid(BLOCK), as_solid(BLOCK ^ tool)
    made = Milling(outer=0.0).run(
        damage=damage, part=Part(block.vertices, block.faces), tolerance=TOLERANCE, others=None
    )
    assert isinstance(made, Deposit)
    assert len(to_manifold(made).decompose()) == 1


@pytest.mark.slow
def test_a_neighbour_across_a_gap_is_left_alone() -> None:
    """The wall of the opening, continued over the gap, cut the tip of the next tooth of a gear."""
    tooth = Manifold.cube((10, 30, 20)).translate((0, -15, -20))
    body = tooth + tooth.translate((14, 0, 0)) + Manifold.cube((24, 30, 4)).translate((0, -15, -24))
    tool = Manifold.cube((16, 12, 12), True).translate((4, 0, 0))
    _, cavity, made = prepare(tool - Manifold.cube((4, 40, 40), True).translate((12, 0, 0)), body, 0.4, wall_angle=40)
    assert made.milled is not None
    assert made.milled.volume > 50  # the walls of its own tooth lean
    assert cavity.bounding_box()[3] <= 10 + 1e-6
    assert made.bounds[1, 0] <= 10 + 1e-6


@pytest.mark.slow
def test_what_stands_over_the_damage_is_removed_across_a_gap_too() -> None:
    """As a lip over a groove: nothing reaches the damage under it."""
    lip = Manifold.cube((60, 40, 2)).translate((-30, 5, 1))
    post = Manifold.cube((60, 4, 23)).translate((-30, 36, -20))
    _, cavity, made = prepare(Manifold.cube((16, 12, 12), True).translate((0, 8, 0)), BLOCK + lip + post, 0.4)
    assert cavity.bounding_box()[5] == pytest.approx(3)
    assert made.milled is not None
