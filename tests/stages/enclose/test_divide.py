"""The part divided along the damage surface: right with every background, wherever the rim lies, or refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Mesh, Part, Solid, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.loops import trace_loops
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.stages.background.bbox import BoundingBox
from damageest.stages.background.capsule import Capsule
from damageest.stages.background.minkowski import Minkowski
from damageest.stages.boundary.all_loops import AllLoops
from damageest.stages.enclose import NotSeparatedError
from damageest.stages.enclose._outside import extend_outside
from damageest.stages.enclose.divide import Divide, Side
from tests.stages._open import bowl, pipe
from tests.stages.enclose.test_shortest_path import NO_POINTS, SIZE, TOLERANCE, sample_intact, volume

BACKGROUNDS = {"bbox": BoundingBox(), "minkowski": Minkowski(), "capsule": Capsule()}


@pytest.fixture(scope="module")
def part() -> Part:
    box = trimesh.creation.box(SIZE)
    return Part(box.vertices, box.faces)


def enclose(
    part: Part, surface: Surface, intact: np.ndarray, background: str = "minkowski", side: Side = "auto"
) -> Mesh:
    rims = AllLoops().run(surface, part, TOLERANCE)
    behind = BACKGROUNDS[background].run(part, surface, TOLERANCE, TOLERANCE / 2, False)
    return Divide(side=side).run(surface, rims, behind, part, intact, TOLERANCE)


@pytest.mark.variants(1)
@pytest.mark.parametrize("background", BACKGROUNDS)
@pytest.mark.parametrize("turned", [False, True])
def test_pit(part: Part, background: str, turned: bool) -> None:
    surface = bowl(6, 10, TOLERANCE)
    if turned:  # the orientation of the surface must not decide the side
        surface = Surface(surface.vertices, surface.faces[:, ::-1])
    mesh = enclose(part, surface, sample_intact(part, 6), background)
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(2 / 3 * np.pi * 6**3, rel=0.01)


@pytest.mark.slow
def test_a_rim_that_runs_over_the_boxs_edge(part: Part) -> None:
    """A ball out of the block's edge: images on two sides of the box, joined round its edge."""
    ball = trimesh.creation.icosphere(5, 6)
    ball.apply_translation([0, 15, 10])
    inside = (np.abs(ball.triangles) < SIZE / 2 - TOLERANCE).all(axis=(1, 2))
    surface = ball.submesh([np.flatnonzero(inside)], append=True)
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces), 8000, seed=1)
    intact = np.asarray(points[np.linalg.norm(points - [0, 15, 10], axis=1) > 6])
    for name in ("bbox", "minkowski"):
        mesh = enclose(part, Surface(surface.vertices, surface.faces[:, ::-1]), intact, name)
        assert open_edges(mesh.faces) == 0
        assert volume(mesh, part) == pytest.approx(np.pi * 6**3 / 3, rel=0.015)


@pytest.mark.slow
@settings(max_examples=12)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1))
def test_where_the_border_lies_in_metal_it_is_known(y: float, z: float, x: float) -> None:
    """It may dip into the part between two nodes where the skin turns; there the metal is opened, and nowhere else."""
    corner = np.array([20 * x, 15 + y, 10 + z])
    box = trimesh.creation.box(SIZE)
    part = Part(box.vertices, box.faces)
    ball = trimesh.creation.icosphere(4, 6)
    ball.apply_translation(corner)
    inside = (np.abs(ball.triangles) < SIZE / 2 - TOLERANCE).all(axis=(1, 2))
    mesh = ball.submesh([np.flatnonzero(inside)], append=True)
    surface = Surface(mesh.vertices, mesh.faces[:, ::-1])
    sheet = extend_outside(surface, AllLoops().run(surface, part, TOLERANCE), part, 3 * TOLERANCE, TOLERANCE)
    (border,) = trace_loops(sheet.mesh.faces)
    at = sheet.mesh.vertices[border]
    share = np.linspace(0, 1, 200, endpoint=False)[:, None, None]
    fine = (at + share * (np.roll(at, -1, axis=0) - at)).reshape(-1, 3)
    depth = -signed_distance(fine, part)[0]
    for place, deep in zip(fine[depth > 0], depth[depth > 0], strict=True):
        assert (np.linalg.norm(sheet.places - place, axis=1) + deep < 1.1 * sheet.deep).any()


@pytest.mark.variants(1)
@pytest.mark.parametrize("background", BACKGROUNDS)
def test_worn_through(part: Part, background: str) -> None:
    """Two rims on opposite faces, and between them nothing but the wall of the hole."""
    surface = pipe(5, -10 + TOLERANCE, 10 - TOLERANCE)
    mesh = enclose(part, surface, sample_intact(part, 5), background)
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(np.pi * 25 * 20, rel=0.01)


@pytest.mark.variants(1)
@pytest.mark.parametrize("background", BACKGROUNDS)
def test_a_pit_in_the_wall_of_a_bore(background: str) -> None:
    """The straight way from its rim to the background runs through metal."""
    tube = trimesh.creation.annulus(10, 14, 40, sections=128)
    part = Part(tube.vertices, tube.faces)
    pit = bowl(4, 0, TOLERANCE)
    inward = Surface(np.column_stack([10 - pit.vertices[:, 2], pit.vertices[:, 1], pit.vertices[:, 0]]), pit.faces)
    # The bowl's rim lies in a plane, but the bore is round: cut off what sticks out of the metal.
    keep = np.hypot(*inward.vertices[:, :2].T) > 10 + TOLERANCE
    cut = trimesh.Trimesh(inward.vertices, inward.faces, process=False)
    cut = cut.submesh([np.flatnonzero(keep[inward.faces].all(axis=1))], append=True)
    points, _ = trimesh.sample.sample_surface(tube, 20_000, seed=1)
    lost = (np.hypot(points[:, 0], points[:, 1]) < 11) & (np.hypot(points[:, 1], points[:, 2]) < 4) & (points[:, 0] > 0)
    mesh = enclose(part, Surface(cut.vertices, cut.faces), np.asarray(points[~lost]), background)
    assert open_edges(mesh.faces) == 0
    ball = trimesh.creation.icosphere(5, 4)
    true = (to_manifold(Mesh(np.add(ball.vertices, (10, 0, 0)), ball.faces)) ^ to_manifold(part)).volume()
    assert volume(mesh, part) == pytest.approx(true, rel=0.015)


def test_one_face_of_a_cut_ring_separates_nothing() -> None:
    ring = trimesh.creation.torus(15, 4, major_sections=96, minor_sections=48)
    part = Part(ring.vertices, ring.faces)
    disc = bowl(4 - TOLERANCE, 0, 0.3)
    flat = disc.vertices * [1, 1, 0]
    intact, _ = trimesh.sample.sample_surface(ring, 4000, seed=1)
    with pytest.raises(NotSeparatedError):
        enclose(part, Surface(np.column_stack([flat[:, 0] + 15, flat[:, 2], flat[:, 1]]), disc.faces), intact)


def test_a_surface_without_intact_points_is_refused(part: Part) -> None:
    with pytest.raises(StageError, match="side"):
        enclose(part, bowl(6, 10, TOLERANCE), NO_POINTS)


@pytest.mark.variants(1)
@pytest.mark.parametrize(("side", "share"), [("smaller", 0.0), ("larger", 1.0)])
def test_a_job_can_say_the_side(part: Part, side: Any, share: float) -> None:
    """Also where no intact point shows it."""
    pit = 2 / 3 * np.pi * 6**3
    mesh = enclose(part, bowl(6, 10, TOLERANCE), NO_POINTS, side=side)
    expected = part.volume - pit if share else pit
    assert volume(mesh, part) == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
def test_the_enclosure_reaches_the_background_and_leaves_it_nowhere(part: Part) -> None:
    surface = bowl(6, 10, TOLERANCE)
    mesh = enclose(part, surface, sample_intact(part, 6), "bbox")
    held = BoundingBox().run(part, surface, TOLERANCE, TOLERANCE / 2, False)
    assert mesh.bounds[1, 2] == pytest.approx(held.bounds[1, 2], abs=1e-6)
    assert (mesh.bounds[0] > held.bounds[0] - 1e-6).all()


@pytest.mark.slow
def test_metal_beyond_the_background_is_not_lost(part: Part) -> None:
    """A printer's volume that ends within the pit."""
    box = trimesh.creation.box((100, 30, 60))
    box.apply_translation((50, 0, 0))
    surface = bowl(6, 10, TOLERANCE)
    rims = AllLoops().run(surface, part, TOLERANCE)
    mesh = Divide().run(surface, rims, Solid(box.vertices, box.faces), part, sample_intact(part, 6), TOLERANCE)
    assert volume(mesh, part) == pytest.approx(np.pi * 6**3 / 3, rel=0.01)


@pytest.mark.slow
def test_a_shallow_bowl_whose_rim_nearly_lies_in_the_skin(part: Part) -> None:
    """Its own direction leaves the part only far away: the way out is the shortest one."""
    ball = bowl(60, 10 + 60 - 1.2, TOLERANCE)
    near = (ball.vertices[ball.faces][:, :, 2] < 10 - TOLERANCE).all(axis=1)
    cut = trimesh.Trimesh(ball.vertices, ball.faces, process=False).submesh([np.flatnonzero(near)], append=True)
    radius = np.sqrt(60**2 - 58.8**2)
    mesh = enclose(part, Surface(cut.vertices, cut.faces), sample_intact(part, radius))
    true = np.pi * 1.2**2 * (60 - 1.2 / 3)
    assert volume(mesh, part) == pytest.approx(true, rel=0.1)


@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
def test_pieces_that_bound_a_loss_together_may_face_any_way(turned: tuple[bool, bool]) -> None:
    """A ring whose one bar is cut out: neither end divides the ring, and nobody knows which way each surface faces."""
    ring = to_manifold(Solid(*_make_box((40, 30, 4))), np.zeros(3)) - to_manifold(
        Solid(*_make_box((32, 22, 6))), np.zeros(3)
    )
    vertices, faces = to_arrays(ring, np.zeros(3))
    part = Part(vertices, faces)
    pieces = [_make_end(x, flip) for x, flip in zip((-4.0, 5.0), turned, strict=True)]
    count = len(pieces[0].vertices)
    surface = Surface(
        np.concatenate([one.vertices for one in pieces]), np.concatenate([pieces[0].faces, pieces[1].faces + count])
    )
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, faces), 6000, seed=2)
    is_gone = (points[:, 0] > -4.5) & (points[:, 0] < 5.5) & (points[:, 1] > 0)
    mesh = enclose(part, surface, np.asarray(points[~is_gone]))
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(9 * 4 * 4, rel=0.01)


def _make_box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(size)
    return np.asarray(box.vertices), np.asarray(box.faces)


def _make_end(x: float, turned: bool) -> Surface:
    """The end of the upper bar at x, a tolerance inside its skin all round."""
    y, z = np.meshgrid(np.linspace(11 + TOLERANCE, 15 - TOLERANCE, 9), np.linspace(-2 + TOLERANCE, 2 - TOLERANCE, 9))
    at = np.stack([np.full(81, x), y.ravel(), z.ravel()], axis=1)
    first = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([first[:, None] + [0, 1, 9], first[:, None] + [1, 10, 9]])
    return Surface(at, faces[:, ::-1] if turned else faces)
