"""CAD solids moved by a field: faces follow it, and go on sharing their edges."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from damageest_cadquery.moving._interpolate import Breaks, evaluate, interpolate_curve
from damageest_cadquery.moving.adapted import require_sound
from damageest_cadquery.moving.moved import MoveError, move_solid
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.split import measure_volume, triangulate

from damageest.artefacts import DisplacementField, Floats, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.refinement import cut_into_cells
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

SHAPES: dict[str, Callable[[], Any]] = {
    "block with a bore and fillets": lambda: (
        cq.Workplane().box(30, 20, 12).faces(">Z").workplane().hole(6).edges("|Z").fillet(2)
    ),
    "sphere": lambda: cq.Workplane().sphere(6),
    "cone with its tip": lambda: cq.Workplane(obj=cq.Solid.makeCone(10, 0, 20)),
    "torus": lambda: cq.Workplane(obj=cq.Solid.makeTorus(12, 4)),
    "loft": lambda: cq.Workplane().rect(20, 10).workplane(offset=30).circle(6).loft(),
    "spline edge": lambda: (
        cq.Workplane().lineTo(0, 5).spline([(10, 8), (20, 3), (30, 9)], includeCurrent=True).lineTo(30, 0).close()
        .extrude(12)
    ),
    "hollow with two shells": lambda: cq.Workplane().box(30, 20, 12).cut(cq.Workplane().box(10, 8, 6)),
    "crossing bores": lambda: (
        cq.Workplane().box(30, 30, 30).faces(">Z").workplane().hole(10).faces(">Y").workplane().hole(8)
    ),
    "placed in an assembly": lambda: cq.Workplane(
        obj=cq.Workplane().box(30, 20, 12).val().moved(cq.Location(cq.Vector(5, 0, 3), cq.Vector(0, 0, 1), 30))
    ),
}  # fmt: skip


def bend(places: Floats) -> Floats:
    """An arc, to second order."""
    x, z = places[:, 0], places[:, 2]
    return np.asarray(places + np.column_stack([-0.008 * x * z, 0 * x, 0.004 * x**2]))


def roughen(places: Floats) -> Floats:
    """A lattice of four cells, three and two."""
    low = np.array([-30.0, -30, -30])
    controls = 0.15 * np.random.default_rng(1).normal(size=(7, 6, 5, 3))
    return DisplacementField(low, -low, controls).move(places)


def take_solid(shape: Any) -> Any:
    return shape.solids().vals()[0].wrapped


DEAR = ("block with a bore and fillets", "sphere", "cone with its tip", "torus", "loft", "crossing bores")
"""Each takes 1 s and more where it is roughened."""


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("name", "move"),
    [
        pytest.param(name, move, marks=[pytest.mark.slow] if move is roughen and name in DEAR else [])
        for name in SHAPES
        for move in (bend, roughen)
    ],
)
def test_moved_solids_are_sound_and_follow(name: str, move: Callable[[Floats], Floats]) -> None:
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_VERTEX

    solid = take_solid(SHAPES[name]())
    moved = move_solid(solid, move, 1e-5, 0.01)
    require_sound([moved])
    for kind in (TopAbs_SHELL, TopAbs_FACE, TopAbs_EDGE, TopAbs_VERTEX):
        assert len(explore(moved, kind)) == len(explore(solid, kind))
    fine, _ = cut_into_cells(triangulate(solid, 0.01), 1.5)
    truth = Solid(move(fine.vertices), fine.faces)
    assert distance_to_mesh(triangulate(moved, 0.02).vertices, truth).max() < 0.03
    assert measure_volume(moved) == pytest.approx(truth.volume, rel=0.003)


def test_faces_stay_in_their_order() -> None:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_FACE

    solid = take_solid(SHAPES["block with a bore and fillets"]())
    areas = []
    for shape in (solid, move_solid(solid, lambda places: places + np.array([1.0, 2.0, 3.0]), 1e-5, 0.01)):
        sizes = [GProp_GProps() for _ in explore(shape, TopAbs_FACE)]
        for face, size in zip(explore(shape, TopAbs_FACE), sizes, strict=True):
            BRepGProp.SurfaceProperties_s(face, size)
        areas.append([size.Mass() for size in sizes])
    assert np.allclose(areas[0], areas[1], rtol=1e-5)


@pytest.mark.slow
def test_a_field_that_is_too_fine_for_the_faces_is_refused() -> None:
    def shake(places: Floats) -> Floats:
        return np.asarray(places + 0.3 * np.sin(9 * places[:, [1, 2, 0]]))

    with pytest.raises(MoveError, match="face 0 is up to"):
        move_solid(take_solid(SHAPES["block with a bore and fillets"]()), shake, 1e-5, 0.01)


def test_a_face_that_folds_is_not_sound() -> None:
    def fold(places: Floats) -> Floats:
        return np.asarray(places * [-1.0, 1.0, 1.0])

    with pytest.raises(MoveError):
        require_sound([move_solid(take_solid(SHAPES["spline edge"]()), fold, 1e-5, 0.01)])


def test_a_cubic_needs_no_knots_and_a_kink_keeps_its_own() -> None:
    def take_cubic(t: Floats) -> Floats:
        return np.column_stack([t, t**3, 1 - t**2])

    axis, _, off = interpolate_curve(take_cubic, Breaks((0.0, 2.0), (3, 3)), 1e-9)
    assert (axis.degree, axis.knots) == (3, (0.0, 2.0))
    assert off < 1e-12

    def take_kink(t: Floats) -> Floats:
        return np.column_stack([t, np.abs(t - 0.7), np.cos(t)])

    axis, poles, off = interpolate_curve(take_kink, Breaks((0.0, 0.7, 2.0), (0, 0, 0)), 1e-9)
    assert off < 1e-9
    at = np.linspace(0, 2, 400)
    assert np.abs(evaluate(axis, poles, at) - take_kink(at)).max() < 1e-8
