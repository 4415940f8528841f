"""Starts, reversals, corners, tilts and air of toolpaths that are drawn by hand."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.paths.practice import Practice, list_beads, measure_practice

from damageest.artefacts import DepositPath, Floats, Mesh, Solid
from damageest.geometry.solids import to_solid

WIDTH, HEIGHT = 2.0, 1.0


def make_floor() -> Solid:
    from manifold3d import Manifold

    floor = to_solid(Manifold.cube((60, 60, 10), True).translate((0, 0, -5)))
    assert floor is not None
    return floor


def draw(*beads: Floats, layers: list[int] | None = None, axes: Floats | None = None) -> DepositPath:
    """A path of these beads (K,3), each in its layer; between two of them the process is off."""
    points = np.concatenate(beads)
    on = np.concatenate([np.arange(len(bead)) > 0 for bead in beads])
    layer = np.repeat(layers or [1] * len(beads), [len(bead) for bead in beads])
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    return DepositPath(
        points=points, axes=up if axes is None else axes, normals=up, feed=np.full(len(points), 600.0), on=on,
        layer=layer, number=np.repeat(np.arange(len(beads)) + 1, [len(bead) for bead in beads]),
        part=np.ones(len(points), int), directions=up[:1], heights=np.array([HEIGHT]), width=WIDTH,
        section=np.array([WIDTH * HEIGHT]), standoff=10.0, deposit_volume=1.0, nozzle=mesh,
        clearance=1.0, travel_clearance=1.0,
    )  # fmt: skip


def line(start: tuple[float, float], end: tuple[float, float], z: float = HEIGHT) -> Floats:
    """Points a quarter of a bead apart, on the top of a bead whose foot is at ``z`` less its height."""
    a, b = np.array([*start, z]), np.array([*end, z])
    return np.asarray(a + np.linspace(0, 1, max(2, round(4 * float(np.linalg.norm(b - a)) / WIDTH)))[:, None] * (b - a))


def ask(*beads: Floats, **options: object) -> Practice:
    return measure_practice(draw(*beads, **options), make_floor())  # type: ignore[arg-type]


def test_rows_that_lie_on_metal_have_no_fault() -> None:
    found = ask(line((-10, 0), (10, 0)), line((10, 10), (-10, 10)))
    assert found == Practice(2.0, 1.0, 0, 0, 0, 0.0, 0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("gap", "count"), [(0.8, 1), (1.2, 0)])
def test_a_bead_that_starts_where_the_last_ended_could_be_joined(gap: float, count: int) -> None:
    beads = line((-10, 0), (0, 0)), line((gap, 0), (10, 0))
    assert ask(*beads).joinable == count
    assert ask(*beads, layers=[1, 2]).joinable == 0
    assert ask(*beads, layers=[1, 2]).starts_a_layer == 1


def test_starts_are_those_of_a_region_whose_beads_touch() -> None:
    far, beside = line((-10, 10), (10, 10)), line((-10, 0.7 * WIDTH), (10, 0.7 * WIDTH))
    found = ask(line((-10, 0), (10, 0)), beside, far)
    assert (found.starts_a_layer, found.starts_a_region) == (3.0, 1.5)


@pytest.mark.parametrize(
    ("back", "reversals", "corners"), [((-10, 0.4), 1, 1), ((0, 10), 0, 1), ((18, 3), 0, 0), ((-10, 10), 0, 1)]
)
def test_a_bead_that_turns_back_is_a_reversal(back: tuple[float, float], reversals: int, corners: int) -> None:
    found = ask(np.concatenate([line((-10, 0), (0, 0)), line((0, 0), back)[1:]]))
    assert (found.reversals, found.corners) == (reversals, corners)


def test_a_tilted_axis_and_its_jump_are_counted() -> None:
    bead = line((-10, 0), (10, 0))
    axes = np.tile([0.0, 0.0, 1.0], (len(bead), 1))
    axes[:10] = [np.sin(0.6), 0, np.cos(0.6)]
    found = ask(bead, axes=axes)
    assert found.jumps == 1
    assert found.tilted == pytest.approx(9 / (len(bead) - 1), abs=0.01)


@pytest.mark.parametrize(("air", "floating"), [(0.1, 0.0), (0.5, 1.0)])
def test_air_under_the_first_layer_is_a_share_of_its_height(air: float, floating: float) -> None:
    found = ask(line((-10, 0), (10, 0), HEIGHT * (1 + air)))
    assert found.air == pytest.approx(air, abs=1e-5)
    assert found.air_95 == pytest.approx(air, abs=1e-5)
    assert found.floating == floating


def test_an_oblique_tool_puts_no_air_under_a_bead() -> None:
    bead = line((-10, 0), (10, 0))
    found = ask(bead, axes=np.tile([np.sin(1.0), 0.0, np.cos(1.0)], (len(bead), 1)))
    assert found.air_95 == pytest.approx(0, abs=1e-9)
    assert found.floating == 0


def test_a_second_layer_lies_on_the_first() -> None:
    found = ask(line((-10, 0), (10, 0)), line((-10, 0), (10, 0), 2.5 * HEIGHT), layers=[1, 2])
    assert found.floating == pytest.approx(0.5, abs=0.05)
    assert found.air == pytest.approx(0)


def test_a_bead_begins_before_its_first_move() -> None:
    path = draw(line((-10, 0), (10, 0)), line((10, 10), (-10, 10)))
    assert [len(bead) for bead in list_beads(path)] == [40, 40]
