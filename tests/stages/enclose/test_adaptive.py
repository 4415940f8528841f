"""A background refined along the rim only: as accurate as one that is fine everywhere, and much smaller."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh, Part, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.solids import to_manifold
from damageest.stages.background.bbox import BoundingBox
from damageest.stages.background.capsule import Capsule
from damageest.stages.background.minkowski import Minkowski
from damageest.stages.boundary.all_loops import AllLoops
from damageest.stages.enclose import NotSeparatedError
from damageest.stages.enclose.adaptive import Adaptive
from tests.stages._open import bowl, pipe
from tests.stages.enclose.test_shortest_path import NO_POINTS, SIZE, TOLERANCE, sample_intact, volume

BACKGROUNDS = {"bbox": BoundingBox(), "minkowski": Minkowski(), "capsule": Capsule()}


@pytest.fixture(scope="module")
def part() -> Part:
    box = trimesh.creation.box(SIZE)
    return Part(box.vertices, box.faces)


def enclose(part: Part, surface: Surface, intact: np.ndarray, background: str = "minkowski") -> Mesh:
    rims = AllLoops().run(surface, part, TOLERANCE)
    behind = BACKGROUNDS[background].run(part, surface, TOLERANCE, TOLERANCE / 2, False)
    return Adaptive().run(surface, rims, behind, part, intact, TOLERANCE)


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
    for name in BACKGROUNDS:
        mesh = enclose(part, Surface(surface.vertices, surface.faces[:, ::-1]), intact, name)
        assert open_edges(mesh.faces) == 0
        assert volume(mesh, part) == pytest.approx(np.pi * 6**3 / 3, rel=0.015)


@pytest.mark.slow
def test_worn_through_needs_a_background_close_to_the_part(part: Part) -> None:
    surface = pipe(5, -10 + TOLERANCE, 10 - TOLERANCE)
    mesh = enclose(part, surface, sample_intact(part, 5))
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(np.pi * 25 * 20, rel=0.01)


@pytest.mark.slow
def test_a_background_on_the_far_side_of_metal_is_refused() -> None:
    """A pit in the wall of a bore: the strip from there to the bounding box runs through the wall."""
    tube = trimesh.creation.annulus(10, 14, 40, sections=128)
    part = Part(tube.vertices, tube.faces)
    pit = bowl(4, 0, TOLERANCE)
    inward = Surface(np.column_stack([10 - pit.vertices[:, 2], pit.vertices[:, 1], pit.vertices[:, 0]]), pit.faces)
    # The bowl's rim lies in a plane, but the bore is round: cut off what sticks out of the metal.
    keep = np.hypot(*inward.vertices[:, :2].T) > 10 + TOLERANCE
    cut = trimesh.Trimesh(inward.vertices, inward.faces, process=False)
    cut = cut.submesh([np.flatnonzero(keep[inward.faces].all(axis=1))], append=True)
    surface = Surface(cut.vertices, cut.faces)
    points, _ = trimesh.sample.sample_surface(tube, 20_000, seed=1)
    lost = (np.hypot(points[:, 0], points[:, 1]) < 11) & (np.hypot(points[:, 1], points[:, 2]) < 4) & (points[:, 0] > 0)
    with pytest.raises(StageError, match="runs through the part") as caught:
        enclose(part, surface, np.asarray(points[~lost]), "bbox")
    assert "minkowski" in caught.value.remedy
    mesh = enclose(part, surface, np.asarray(points[~lost]))
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


def test_cost_follows_the_rim_and_not_the_part() -> None:
    """The same dent in a part ten times as long needs few more triangles."""
    counts = []
    for length in (40.0, 400.0):
        box = trimesh.creation.box((length, 30, 20))
        part = Part(box.vertices, box.faces)
        mesh = enclose(part, bowl(6, 10, TOLERANCE), sample_intact(part, 6, 20_000), "bbox")
        counts.append(len(mesh.faces))
    assert counts[1] < 1.2 * counts[0]
    assert counts[0] < 20_000
