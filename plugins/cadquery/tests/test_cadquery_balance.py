"""Cuts that are moved so that the exact damage volume is as large as the mesh, and cuts that cross themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Mesh, Part, Solid, Surface
from damageest.geometry.undoing import count_crossings, find_crossings
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")
TOLERANCE = 0.2


def mesh_part(shape: Any, chord: float) -> Part:
    from damageest_cadquery.reading.tessellate import tessellate

    from damageest.geometry.make_part import make_part

    found = tessellate([shape.val().wrapped], chord, 30.0, lambda face: "")
    return make_part(
        found.vertices, found.faces, "mm", path="part.step", sha256="", faces_brep=found.faces_brep,
        face_names=found.names, face_kinds=found.kinds, tessellation_error=found.error, cad_scale=1.0,
    )  # fmt: skip


def cut_off(part: Mesh, x: float) -> Solid:
    """What of a mesh lies beyond a plane x = const."""
    from damageest.geometry.solids import to_manifold, to_solid

    origin = np.zeros(3)
    taken = to_solid(to_manifold(part, origin).trim_by_plane((1, 0, 0), x), origin)
    assert taken is not None
    return taken


def cut_exactly(shape: Any, x: float) -> Any:
    """What of a solid lies beyond a plane x = const, as pieces of which that plane's face is inside the part."""
    from damageest_cadquery.solids.joining import explore_faces
    from damageest_cadquery.solids.split import Piece

    box = cq.Workplane().box(100, 100, 100).translate((50 + x, 0, 0))
    solid = shape.intersect(box).val().Solids()[0].wrapped
    inner = [abs(cq.Face(face).Center().x - x) < 1e-9 for face in explore_faces(solid)]
    return [Piece(solid, 0, tuple((-1, 0) if each else (0, -1) for each in inner))]


def test_the_step_is_the_distance_between_the_cuts() -> None:
    from damageest_cadquery.cutting._balance import Balance
    from damageest_cadquery.cutting.exact_damage import start_solids

    block = cq.Workplane().box(30, 20, 12)
    part = mesh_part(block, 0.1)
    solids, _ = start_solids([block.val().wrapped])
    for off in (0.01, -0.02):
        balance = Balance(solids, part, cut_off(part, 13.0), TOLERANCE)
        # where the exact cut lies deeper it has to go back: the damage volume's outside is where x is smaller
        assert balance.find_step(cut_exactly(block, 13.0 + off)) == pytest.approx(off, rel=1e-3)
    assert Balance(solids, part, cut_off(part, 13.0), TOLERANCE).find_step(cut_exactly(block, 13.002)) == 0.0
    assert Balance(solids, part, cut_off(part, 13.0), TOLERANCE).find_step(cut_exactly(block, 13.1)) == 0.0, "too far"


def test_chords_are_not_taken_for_a_cut_that_is_off() -> None:
    from damageest_cadquery.cutting._balance import Balance
    from damageest_cadquery.cutting.check_pieces import measure_inner_area
    from damageest_cadquery.cutting.exact_damage import start_solids
    from damageest_cadquery.solids.split import measure_volume

    for shape, sign in (
        (cq.Workplane().cylinder(20, 10), 1),
        (cq.Workplane().box(30, 30, 20).faces(">Z").workplane().hole(20), -1),
    ):
        part = mesh_part(shape, 0.05)
        solids, _ = start_solids([shape.val().wrapped])
        x = 9.0 if sign > 0 else -12.0
        lost, pieces = cut_off(part, x), cut_exactly(shape, x)

        true = measure_volume(pieces[0].shape) - lost.volume
        assert sign * true > 0.0
        balance = Balance(solids, part, lost, TOLERANCE)
        assert balance.measure_chords(pieces) == pytest.approx(true, rel=0.15)
        # what the finer triangles leave of the chords
        area = measure_inner_area(pieces)
        assert abs(balance.find_step(pieces)) < 0.2 * abs(true) / area


def test_a_cut_is_moved_to_the_volume_of_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    from damageest_cadquery.cutting import exact_damage as _exact
    from damageest_cadquery.cutting._attempts import Attempt
    from damageest_cadquery.solids.split import Tool, measure_volume

    block = cq.Workplane().box(30, 20, 12)
    part = mesh_part(block, 0.1)
    lost = cut_off(part, 12.0)

    def build(x: float) -> Tool:
        face = cq.Face.makePlane(40, 40, (x, 0, 0), (1, 0, 0)).wrapped
        return Tool([face], face)

    def list_tools(*_: Any) -> Iterator[Attempt]:
        # 0.8 % too small, which is refused as it is; outward of the damage volume is toward smaller x
        yield Attempt("facets 2", lambda: build(12.024), (1e-6,), lambda step: build(12.024 - step))

    monkeypatch.setattr(_exact, "make_cut", lambda *_: object())
    monkeypatch.setattr(_exact, "list_tools", list_tools)
    corners = np.array([[12, y, z] for y in (-10, 10) for z in (-6, 6)], float)
    surface = Surface(corners, np.array([[0, 1, 3], [0, 3, 2]]))
    site = _exact.SiteInput(1, lost, surface, (lost,), np.empty((0, 3)), True)
    solids, faces = _exact.start_solids([block.val().wrapped])
    found, tried = _exact.find_exact(site, solids, faces, part, TOLERANCE)
    assert found is not None, tried
    assert sum(measure_volume(piece.shape) for piece in found.pieces) == pytest.approx(lost.volume, rel=1e-6)


@pytest.mark.slow
def test_of_forms_that_pass_the_one_with_the_nearest_volume_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a curved part the check of the volume has room for chords; where these are small, it is too much."""
    from damageest_cadquery.cutting import exact_damage as _exact
    from damageest_cadquery.cutting._attempts import Attempt
    from damageest_cadquery.solids.split import Tool

    shaft = cq.Workplane().cylinder(20, 10)
    part = replace(mesh_part(shaft, 0.002), tessellation_error=0.1)
    lost = cut_off(part, 7.0)

    def build(x: float) -> Tool:
        face = cq.Face.makePlane(40, 40, (x, 0, 0), (1, 0, 0)).wrapped
        return Tool([face], face)

    corners = np.array([[7, y, z] for y in (-7, 7) for z in (-10, 10)], float)
    surface = Surface(corners, np.array([[0, 1, 3], [0, 3, 2]]))
    site = _exact.SiteInput(1, lost, surface, (lost,), np.empty((0, 3)), True)
    solids, faces = _exact.start_solids([shaft.val().wrapped])
    monkeypatch.setattr(_exact, "make_cut", lambda *_: object())

    def take(*places: float) -> float:
        tools = [Attempt(f"facets {k}", partial(build, x), (1e-6,)) for k, x in enumerate(places)]
        monkeypatch.setattr(_exact, "list_tools", lambda *_: iter(tools))
        found, tried = _exact.find_exact(site, solids, faces, part, TOLERANCE)
        assert found is not None, tried
        return found.measured.volume / lost.volume - 1

    assert abs(take(7.03, 7.001, 7.0)) == pytest.approx(abs(take(7.001)), rel=1e-6), "the first that is near"
    assert abs(take(7.04, 7.03, 7.035)) == pytest.approx(abs(take(7.03)), rel=1e-6), "the nearest, where none is"


def make_folded(height: float) -> Mesh:
    """A grid of which two vertices are pulled past one another."""
    from test_cadquery_surfaces import make_grid

    points, faces = make_grid(9, 8.0)
    points[:, 2] = 0.2 * np.sin(points[:, 0])
    for x, step in ((3.0, 1.6), (5.0, -1.6)):
        points[np.linalg.norm(points[:, :2] - [x, 4.0], axis=1).argmin()] += [step, 0.1 * step, -height]
    return Mesh(points, faces)


def test_a_surface_that_crosses_itself_is_untangled() -> None:
    from damageest_cadquery.surfaces._untangle import keep_apart, untangle

    folded = make_folded(0.3)
    edges, crossed = find_crossings(folded)
    assert len(edges) == len(crossed) == count_crossings(folded) > 0
    apart = untangle(folded, 3.0)
    assert count_crossings(apart) == 0
    moved: Floats = np.linalg.norm(apart.vertices - folded.vertices, axis=1)
    assert 0 < (moved > 0).sum() < len(moved) / 3, "only round the fold"
    assert untangle(folded, 0.1) is folded, "not farther than is allowed"
    assert untangle(apart, 3.0) is apart
    back = keep_apart(folded, apart.vertices)
    assert count_crossings(back) == 0


def test_a_crossing_of_large_triangles_moves_a_small_part_of_the_surface() -> None:
    from damageest_cadquery.surfaces._untangle import refine_crossings, untangle

    from damageest.geometry.distance import distance_to_mesh

    folded = make_folded(0.3)
    fine, origin = refine_crossings(folded, 0.5)
    assert len(origin) == len(fine.faces) > len(folded.faces)
    areas: Floats = np.linalg.norm(fine.cross, axis=1)
    assert np.bincount(origin, weights=areas) == pytest.approx(np.linalg.norm(folded.cross, axis=1)), "the same surface"

    def measure_moved(mesh: Mesh) -> float:
        apart = untangle(mesh, 3.0)
        assert count_crossings(apart) == 0
        return float(np.linalg.norm(fine.vertex_cross, axis=1) @ (distance_to_mesh(fine.vertices, apart) > 0.1))

    assert measure_moved(fine) < 0.8 * measure_moved(folded)
    same, rows = refine_crossings(untangle(folded, 3.0), 0.5)
    assert len(same.faces) == len(rows) == len(folded.faces), "none without crossings"
