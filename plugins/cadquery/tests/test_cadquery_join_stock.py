"""Stock over poles of spheres, on coplanar faces, and where that of a spline meets other stock; volumes are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damageest_cadquery.solids.joining import StockError, explore_faces, naming
from damageest_cadquery.solids.split import measure_volume, triangulate
from damageest_cadquery.stock._edges import find_edges
from damageest_cadquery.stock._join import Lump, sew_groups
from damageest_cadquery.stock.offset_faces import Base, build_parts, build_stock

from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

HIGH = 0.5


def take_bases(shape: Any, is_outer: Any) -> list[Base]:
    faces = shape.val().Solids()[0].Faces()
    return [Base(face.wrapped, k, HIGH) for k, face in enumerate(faces) if is_outer(face)]


def test_the_corner_of_a_rounded_block_is_smooth_and_its_stock_a_larger_radius() -> None:
    """The pole of the sphere is a corner of two fillets: there its derivatives have no normal."""
    radius, flat = 6.0, 8.0
    block = cq.Workplane().box(40, 40, 40).edges().fillet(radius)
    size = radius + flat
    lost = block.intersect(cq.Workplane().box(size, size, size).translate((20 - size / 2,) * 3))
    bases = take_bases(lost, lambda face: min(face.Center().toTuple()) > 20 - size + 0.1)
    assert {edge.kind for edge in find_edges([base.face for base in bases])} == {"smooth"}
    (stock,) = build_stock(bases)
    round_edges = 3 * np.pi / 4 * ((radius + HIGH) ** 2 - radius**2) * flat
    ball = np.pi / 6 * ((radius + HIGH) ** 3 - radius**3)
    assert measure_volume(stock) == pytest.approx(3 * flat**2 * HIGH + round_edges + ball, rel=1e-5)


def test_faces_in_one_plane_get_one_solid_of_stock() -> None:
    lost = cq.Workplane().box(10, 10, 4).union(cq.Workplane().box(10, 10, 4).translate((10, 0, 0)), clean=False)
    bases = take_bases(lost, lambda face: face.Center().z > 1.9)
    assert len(bases) == 2
    (stock,) = build_stock(bases)
    assert measure_volume(stock) == pytest.approx(20 * 10 * HIGH, rel=1e-9)
    assert triangulate(stock, 0.01).volume == pytest.approx(20 * 10 * HIGH, rel=1e-9)


def make_step() -> list[Base]:
    """A wavy spline face and the wall of a boss that stands on it: their stock meets in a concave corner."""
    points = [[cq.Vector(x, y, 4 + 0.8 * np.sin(x / 4) * np.cos(y / 4)) for x in range(-10, 11, 4)]
              for y in range(-10, 11, 4)]  # fmt: skip
    top = cq.Face.makeSplineApprox(points, tol=1e-3)
    body = cq.Workplane().box(16, 16, 16).split(cq.Workplane(obj=top)).solids("<Z")
    boss = cq.Workplane().box(6, 16, 10).translate((5, 0, 3))
    whole = body.union(boss)
    return take_bases(
        whole,
        lambda face: face.geomType() == "BSPLINE" or (abs(face.Center().x - 2) < 1e-6 and face.Center().z > 3),
    )


@pytest.mark.slow  # 10 s; run it by -m slow
def test_the_offset_of_a_spline_is_joined_with_stock_that_it_meets_or_refused() -> None:
    """OpenCASCADE gives two valid solids here that overlap: as large as both together."""
    from manifold3d import Manifold, OpType

    from damageest.geometry.solids import to_manifold

    bases = make_step()
    assert "concave" in {edge.kind for edge in find_edges([base.face for base in bases])}
    parts = [to_manifold(triangulate(lump.solid, 0.01), np.zeros(3)) for lump in build_parts(bases)]
    union = Manifold.batch_boolean(parts, OpType.Add).volume()
    assert union < 0.98 * sum(part.volume() for part in parts), "they share volume in the corner"
    told: tuple[int, ...] = ()
    try:
        stock = build_stock(bases)
    except StockError as error:
        told = error.faces
    assert set(told) <= {base.number for base in bases}
    assert told or sum(triangulate(each, 0.01).volume for each in stock) == pytest.approx(union, rel=3e-3)


def test_solids_that_share_volume_are_not_sewn() -> None:
    def box(*low: float) -> Lump:
        return Lump(cq.Workplane().box(2, 2, 2, centered=False).translate(low).val().wrapped, (int(low[0]),))

    apart = sew_groups([box(0, 0, 0), box(2, 0, 0)], 0.01)
    assert [lump.faces for lump in apart] == [(0, 2)]
    assert len(explore_faces(apart[0].solid)) == 10, "without the two that touch"
    shared = sew_groups([box(0, 0, 0), box(2, 0, 0), box(1, 1, 0)], 0.01)
    assert sorted(lump.faces for lump in shared) == [(0, 2), (1,)]


def test_what_fails_is_told_with_the_faces_and_their_names() -> None:
    names = ["face 0", "Fillet3", *(f"face {k}" for k in range(2, 12))]
    with pytest.raises(StockError) as caught, naming((1, 0)):
        raise StockError("its triangles do not close")
    assert caught.value.describe(names) == "stock on face 0, face 1 (Fillet3): its triangles do not close"
    assert StockError("no", range(9)).describe(names).startswith("stock on face 0, face 1 (Fillet3), face 2,")
    assert "3 more: no" in StockError("no", range(9)).describe(names)
    with pytest.raises(ZeroDivisionError), naming((1,)):
        raise ZeroDivisionError  # not OpenCASCADE's: a fault of the program stays one
