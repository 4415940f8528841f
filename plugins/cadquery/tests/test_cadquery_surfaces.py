"""Surfaces inside the part: what is recognised, simplified, flattened and numbered, on shapes with known truth."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Ints, Mesh, Part
from damageest.geometry.distance import distance_to_mesh
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")
TOLERANCE = 0.2


def make_grid(count: int, size: float) -> tuple[Floats, Ints]:
    """A square of triangles in the plane z = 0, normals up."""
    x = np.linspace(0, size, count)
    points = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((count, count))], axis=-1).reshape(-1, 3)
    number = np.arange(count * count).reshape(count, count)
    a, b, c, d = (k.ravel() for k in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def make_valley(noise: float = 0.02) -> Mesh:
    """Two planes that meet at a right angle along the line x = 5, z = 0, with noise."""
    points, faces = make_grid(51, 10.0)
    points[:, 2] = np.abs(points[:, 0] - 5.0)
    normal = np.column_stack([-np.sign(points[:, 0] - 5), np.zeros(len(points)), np.ones(len(points))]) / np.sqrt(2)
    return Mesh(points + noise * np.random.default_rng(2).normal(size=(len(points), 1)) * normal, faces)


def make_cap(radius: float = 5.0, low: float = 0.0) -> Mesh:
    import trimesh

    ball = trimesh.creation.icosphere(4, radius=radius)
    faces = np.asarray(ball.faces)[ball.triangles_center[:, 2] > low]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(np.asarray(ball.vertices)[used], renumbered.reshape(-1, 3).astype(np.int64))


def make_cut_of(mesh: Mesh) -> Any:
    """A cut all of which lies inside the part."""
    from damageest_cadquery.surfaces.open_surface import Cut

    return Cut(mesh, np.full(len(mesh.vertices), -1.0), np.ones(len(mesh.faces), bool))


def test_planes_and_a_ball_are_recognised() -> None:
    from damageest_cadquery.surfaces.recognised import find_shapes

    found = find_shapes(make_valley(), TOLERANCE)
    assert found.whole
    assert [shape.kind for shape in found.shapes] == ["plane", "plane"]
    truth = np.array([[1, 0, 1], [-1, 0, 1]]) / np.sqrt(2)
    turned = np.abs(np.array([shape.axis for shape in found.shapes]) @ truth.T)
    np.testing.assert_allclose(np.sort(turned.max(axis=1)), 1, atol=1e-4)
    ball = find_shapes(make_cap(), TOLERANCE)
    assert [shape.kind for shape in ball.shapes] == ["sphere"]
    assert ball.shapes[0].radius == pytest.approx(5, abs=0.02)


def test_a_rough_surface_is_made_of_nothing() -> None:
    from damageest_cadquery.surfaces.recognised import find_shapes

    points, faces = make_grid(61, 12.0)
    points[:, 2] = np.sin(2 * points[:, 0]) * np.cos(1.7 * points[:, 1]) + 0.3 * np.sin(5 * points[:, 1])
    assert not find_shapes(Mesh(points, faces), TOLERANCE).whole


def test_two_planes_become_two_faces_with_a_sharp_edge() -> None:
    from damageest_cadquery.surfaces.flat_faces import find_flat_faces
    from damageest_cadquery.surfaces.polyhedron import decimate, fit, mark_planes
    from damageest_cadquery.surfaces.recognised import find_shapes

    valley = make_valley()
    found, cut = find_shapes(valley, TOLERANCE), make_cut_of(valley)
    marked = mark_planes(cut, np.arange(len(valley.faces)), found.label, found.shapes, TOLERANCE)
    less = fit(decimate(marked, 300), cut, TOLERANCE)
    facets = find_flat_faces(less)
    assert len(facets) == 2
    for facet in facets:  # corners on the plane of the face
        corners = less.mesh.vertices[facet.loops[0]]
        assert np.abs((corners - corners[0]) @ facet.normal).max() < 1e-9
    edge = set(facets[0].loops[0].tolist()) & set(facets[1].loops[0].tolist())
    np.testing.assert_allclose(less.mesh.vertices[sorted(edge)][:, [0, 2]], [[5, 0]] * len(edge), atol=0.03)


def test_facets_of_a_ball_are_as_near_as_they_are_many_and_cover_it_once() -> None:
    from damageest_cadquery.surfaces.flat_faces import find_flat_faces
    from damageest_cadquery.surfaces.polyhedron import decimate, fit, mark_planes

    cap = make_cap()
    cut = make_cut_of(cap)
    none = np.full(len(cap.faces), -1)
    flat, far = mark_planes(cut, np.arange(len(cap.faces)), none, (), TOLERANCE), []
    for count in (100, 400):
        less = fit(decimate(flat, count), cut, TOLERANCE)
        far.append(float(np.quantile(distance_to_mesh(cap.vertices, less.mesh), 0.95)))
        facets = find_flat_faces(less)
        assert abs(len(facets) - count) < 5
        edges = [
            (int(a), int(b)) for f in facets for loop in f.loops for a, b in zip(loop, np.roll(loop, -1), strict=True)
        ]
        assert len(set(edges)) == len(edges), "no edge is used twice in one direction"
        radius = np.linalg.norm(less.mesh.vertices, axis=1)
        assert np.median(radius) > 5, "fitted: corners lie outside, so that chords do not lie all inside"
    assert far[1] < far[0] / 2.5
    assert far[1] < 0.06


@pytest.mark.parametrize("hole", [False, True])
def test_a_hemisphere_spreads_over_the_disk_without_a_fold(hole: bool) -> None:
    from damageest_cadquery.surfaces._flatten import flatten
    from damageest_cadquery.surfaces.open_surface import take_faces

    cap = make_cap()
    if hole:
        cap = take_faces(cap, np.flatnonzero(cap.triangles[:, :, 2].mean(axis=1) < 4.8))
    uv = flatten(cap)
    assert uv is not None
    assert np.linalg.norm(uv, axis=1).max() == pytest.approx(1)
    one, two = uv[cap.faces[:, 1]] - uv[cap.faces[:, 0]], uv[cap.faces[:, 2]] - uv[cap.faces[:, 0]]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    assert (np.sign(area) == np.sign(area[0])).all()


def test_a_closed_surface_does_not_spread() -> None:
    from damageest_cadquery.surfaces._flatten import flatten

    assert flatten(make_cap(low=-9)) is None


@pytest.mark.parametrize("count", [3, 6, 8])
def test_a_surface_with_a_short_rim_is_flattened(count: int) -> None:
    from damageest_cadquery.surfaces._flatten import flatten

    angle = 2 * np.pi * np.arange(count) / count
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    around = np.arange(count)
    fan = np.column_stack([around, np.roll(around, -1), np.full(count, count)])
    places = flatten(Mesh(np.concatenate([rim, [[0, 0, 0.2]]]), fan))
    assert places is not None
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), [1] * count + [0], atol=1e-9)


def test_tails_along_the_skin_are_dropped() -> None:
    from damageest_cadquery.surfaces.open_surface import take_faces
    from damageest_cadquery.surfaces.splines import drop_tails

    points, faces = make_grid(81, 16.0)
    middle = points[faces].mean(axis=1)
    body = np.linalg.norm(middle[:, :2] - 5, axis=1) < 4
    tail = (np.abs(middle[:, 1] - 5) < 0.4) & (middle[:, 0] > 5) & (middle[:, 0] < 15)
    kept = drop_tails(take_faces(Mesh(points, faces), np.flatnonzero(body | tail)), 0.8)
    assert kept.vertices[np.unique(kept.faces)][:, 0].max() < 10.2
    assert kept.area == pytest.approx(np.pi * 16, rel=0.06)


def test_step_entities_in_another_order_give_the_same_bytes(tmp_path: Path) -> None:
    from damageest_cadquery.writing._canonical import canonicalise

    cq.exporters.export(cq.Workplane().box(3, 2, 1).faces(">Z").hole(0.5), str(tmp_path / "a.step"))
    text = (tmp_path / "a.step").read_text()
    head, data, tail = re.split(r"(?<=DATA;)\n|(?=ENDSEC;\nEND-ISO)", text)
    entities = re.findall(r"#\d+ ?= ?(?:'(?:[^']|'')*'|[^';])*;", data)
    rng = np.random.default_rng(1)
    number = rng.permutation(len(entities)) + 1
    old = [int(re.match(r"#(\d+)", entity)[1]) for entity in entities]  # type: ignore[index]
    new = dict(zip(old, number.tolist(), strict=True))

    def renumber(entity: str) -> str:  # not within strings
        return re.sub(r"'[^']*'|#(\d+)", lambda found: f"#{new[int(found[1])]}" if found[1] else found[0], entity)

    moved = [renumber(entity) for entity in entities]
    shuffled = [moved[k] for k in rng.permutation(len(moved))]
    (tmp_path / "b.step").write_text(head + "\n" + "\n".join(shuffled) + "\n" + tail)
    for name in ("a", "b"):
        canonicalise(tmp_path / f"{name}.step")
    assert (tmp_path / "a.step").read_bytes() == (tmp_path / "b.step").read_bytes()
    (solid,) = cq.importers.importStep(str(tmp_path / "b.step")).solids().vals()
    assert solid.Volume() == pytest.approx(6 - np.pi / 16, rel=1e-6)


def test_nothing_hangs_in_the_pieces_of_a_split() -> None:
    """Two faces that overlap beyond their common edge, in the shape of a T."""
    from damageest_cadquery.cutting.exact_damage import start_solids
    from damageest_cadquery.solids.split import Tool, is_sound, measure_volume, split
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    solids, _ = start_solids([cq.Workplane().box(10, 10, 10).val().wrapped])
    flat = cq.Face.makePlane(20, 20, (0, 0, 0), (0, 0, 1)).wrapped
    hanging = cq.Face.makePlane(4, 4, (0, 0, 2), (1, 0, 0)).wrapped
    builder, shape = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(shape)
    for face in (flat, hanging):
        builder.Add(shape, face)
    pieces = split(solids[0].shape, 0, solids[0].origins, Tool([flat, hanging], shape), 1e-6)
    assert pieces is not None
    assert sorted(round(measure_volume(piece.shape), 6) for piece in pieces) == [500, 500]
    assert is_sound(pieces)
    assert all(len(piece.origins) == 6 for piece in pieces)


def test_the_volume_of_a_twisted_blade_is_that_of_a_fine_mesh() -> None:
    """OpenCASCADE's own, with a fixed number of points, is 7 % lower."""
    from damageest_benchmarks.exact.parts import make_blade
    from damageest_cadquery.solids.split import measure_volume, triangulate

    blade = make_blade().val().wrapped
    assert measure_volume(blade) == pytest.approx(triangulate(blade, 0.03, 0.2).volume, rel=2e-3)


@pytest.mark.slow
def test_a_picture_shows_faces_inside_in_red_and_others_not(tmp_path: Path) -> None:
    import pyvista as pv
    from damageest_cadquery.draw import main
    from damageest_cadquery.writing.assembly import NamedShape, write_assembly

    shape = cq.Workplane().box(3, 3, 3).val()
    names = ["damage site-1 inner 1" if face.Center().z > 1.4 else "side" for face in shape.Faces()]
    write_assembly(tmp_path / "a.step", "block", [NamedShape("block", shape.wrapped, (9, 9, 9), names)], "mm")
    main([str(tmp_path / "a.step"), "-o", str(tmp_path / "a.png"), "--size", "200x200"])
    image = np.asarray(pv.read(str(tmp_path / "a.png")).active_scalars)[:, :3].astype(int)
    red = (image[:, 0] > image[:, 1] + 60) & (image[:, 0] > image[:, 2] + 20)
    green_or_blue = (np.maximum(image[:, 1], image[:, 2]) > image[:, 0] + 20) & (image.min(axis=1) > 40)
    assert red.sum() > 500
    assert green_or_blue.sum() > 500


def test_the_evaluation_counts_what_failed() -> None:
    from damageest_benchmarks.exact.__main__ import summarise

    good = {"part": "a", "form": "shapes", "faces": 5, "seconds": 2.0, "volume": 10.01, "mesh": 10.0,
            "read_volume": 10.01, "read_valid": True, "read_solids": 1, "gmsh": [0.0, 1.0], "iou_exact": 0.95,
            "iou_mesh": 0.94}  # fmt: skip
    bad = {"part": "b", "form": "none", "faces": 0, "seconds": 60.0}
    text = summarise([good, bad, {"part": "c", "error": "no site"}])
    assert "exact 50.0%" in text
    assert "0.100%" in text
    assert "1 of 1 with the same volume" in text
    assert summarise([bad]) == "1 sites, none exact"


@pytest.mark.slow
def test_a_case_of_the_evaluation_is_exact_and_read_back(tmp_path: Path) -> None:
    from damageest_benchmarks.exact.__main__ import run_case
    from damageest_benchmarks.exact.parts import make_filleted_block

    cq.exporters.export(make_filleted_block(), str(tmp_path / "block.step"))
    rows = run_case(tmp_path / "block.step", 14, tmp_path / "out")
    assert rows
    assert all(row["form"] != "none" for row in rows)
    assert all(row["read_valid"] and row["read_volume"] == pytest.approx(row["volume"], rel=1e-4) for row in rows)
    assert all(row["iou_exact"] > row["iou_mesh"] - 0.01 for row in rows)


@pytest.mark.parametrize("outline", [[[0, 0], [0, 9], [9, 9], [9, 0]], [[4, 4], [4.01, 4], [4, 4.01]]])
def test_a_chart_without_an_outline_gets_no_spline(outline: list[list[float]]) -> None:
    """As where a folded piece of few triangles is flattened: its outline runs the wrong way round, or has no width."""
    import trimesh
    from damageest_cadquery.surfaces.splines import Chart, build_splines

    points, faces = make_grid(10, 9.0)
    points[:, 2] = 0.01 * (points[:, 0] - 4.5) ** 2 - 3
    block = trimesh.creation.box((40, 40, 6))
    part = Part(np.asarray(block.vertices), np.asarray(block.faces))
    chart = Chart(Mesh(points, faces), points[:, :2], np.ones(100, bool), [np.array(outline, float)])
    assert build_splines([chart], part, 8, 0.2) is None
