"""Damage of known volume: closed on the right side, or refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh, Part, Rims, Solid, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.solids import to_manifold
from damageest.stages.background.bbox import BoundingBox
from damageest.stages.background.offset import Offset
from damageest.stages.boundary.all_loops import AllLoops
from damageest.stages.boundary.largest_loop import LargestLoop
from damageest.stages.enclose.shortest_path import ShortestPath
from tests.stages._open import bowl, pipe

TOLERANCE = 0.3
SIZE = np.array([40.0, 30.0, 20.0])
NO_POINTS = np.empty((0, 3))


@pytest.fixture(scope="module")
def part() -> Part:
    box = trimesh.creation.box(SIZE)
    return Part(box.vertices, box.faces)


def sample_intact(part: Part, lost: float, n: int = 8000) -> np.ndarray:
    """Points (N,3) on the part's skin, none within ``lost`` of the z axis."""
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces), n, seed=1)
    return np.asarray(points[np.hypot(points[:, 0], points[:, 1]) > lost])


def volume(enclosure: Mesh, part: Part) -> float:
    solid = Solid(enclosure.vertices, enclosure.faces)
    return float((to_manifold(solid) ^ to_manifold(part)).volume())


def enclose(part: Part, surface: Surface, intact: np.ndarray, background: str = "offset", loops: str = "all") -> Mesh:
    rims = AllLoops().run(surface, part, TOLERANCE) if loops == "all" else LargestLoop().run(surface)
    maker = Offset() if background == "offset" else BoundingBox()
    behind = maker.run(part, surface, TOLERANCE, TOLERANCE / 2, True)
    return ShortestPath().run(surface, rims, behind, part, intact, TOLERANCE)


@pytest.mark.variants(1)
@pytest.mark.parametrize(("background", "turned"), [("offset", False), ("offset", True), ("bbox", False)])
def test_pit(part: Part, background: str, turned: bool) -> None:
    surface = bowl(6, 10, TOLERANCE)
    if turned:  # the orientation of the surface must not decide the side
        surface = Surface(surface.vertices, surface.faces[:, ::-1])
    mesh = enclose(part, surface, sample_intact(part, 6), background)
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(2 / 3 * np.pi * 6**3, rel=0.01)


@pytest.mark.variants(1)
@pytest.mark.parametrize("loops", ["all", "largest"])
def test_worn_through(part: Part, loops: str) -> None:
    surface = pipe(5, -10 + TOLERANCE, 10 - TOLERANCE)
    if loops == "all":
        mesh = enclose(part, surface, sample_intact(part, 5))
        assert open_edges(mesh.faces) == 0
        assert volume(mesh, part) == pytest.approx(np.pi * 25 * 20, rel=0.01)
    else:  # the other end is closed flat where the surface ends, a tolerance below the skin
        mesh = enclose(part, surface, sample_intact(part, 5), loops="largest")
        assert open_edges(mesh.faces) == 0
        assert volume(mesh, part) == pytest.approx(np.pi * 25 * (20 - TOLERANCE), rel=0.01)


@pytest.mark.slow
def test_more_than_half_lost(part: Part) -> None:
    """The larger side is the damage where the intact points are on the smaller."""
    x = np.linspace(-0.5, 0.5, 60)
    grid = np.stack(np.meshgrid(x * (30 - 2 * TOLERANCE), x * (20 - 2 * TOLERANCE), indexing="ij"), axis=-1).reshape(
        -1, 2
    )
    vertices = np.column_stack([np.full(len(grid), -15.0), grid])
    i = (np.arange(59)[:, None] * 60 + np.arange(59)).ravel()
    faces = np.concatenate([np.stack([i, i + 60, i + 1], 1), np.stack([i + 1, i + 60, i + 61], 1)])
    points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces), 8000, seed=1)
    mesh = enclose(part, Surface(vertices, faces), np.asarray(points[points[:, 0] < -15]))
    assert open_edges(mesh.faces) == 0
    assert volume(mesh, part) == pytest.approx(35 * 30 * 20, rel=0.01)


def test_a_surface_without_intact_points_is_refused(part: Part) -> None:
    with pytest.raises(StageError, match="side"):
        enclose(part, bowl(6, 10, TOLERANCE), NO_POINTS)


@pytest.mark.slow
def test_intact_points_on_both_sides_are_refused(part: Part) -> None:
    rng = np.random.default_rng(0)
    angle, radius = rng.uniform(0, 2 * np.pi, 4000), 6 * np.sqrt(rng.random(4000))
    on_pit = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(4000, 10.0)])
    with pytest.raises(StageError, match="intact points"):
        enclose(part, bowl(6, 10, TOLERANCE), np.concatenate([sample_intact(part, 6), on_pit]))


def test_one_face_of_a_cut_ring_splits_nothing() -> None:
    ring = trimesh.creation.torus(15, 4, major_sections=96, minor_sections=48)
    part = Part(ring.vertices, ring.faces)
    disc = bowl(4 - TOLERANCE, 0, 0.3)
    flat = disc.vertices * [1, 1, 0]
    turned = np.column_stack([flat[:, 0] + 15, flat[:, 2], flat[:, 1]])
    intact, _ = trimesh.sample.sample_surface(ring, 4000, seed=1)
    with pytest.raises(StageError, match="do not split"):
        enclose(part, Surface(turned, disc.faces), np.asarray(intact))


def test_rim_smaller_than_the_edges_of_the_background_is_refused(part: Part) -> None:
    surface = bowl(0.4, 10, 0.2)
    behind = BoundingBox(edge=100).run(part, surface, TOLERANCE, 0.1, True)
    with pytest.raises(StageError, match="shrinks to a point"):
        ShortestPath(overhang=0).run(
            surface, AllLoops().run(surface, part, TOLERANCE), behind, part, sample_intact(part, 1), TOLERANCE
        )


@pytest.mark.slow
def test_rims_come_from_the_boundary_stage(part: Part) -> None:
    """A loop that boundary left out is closed flat, so that no edge is open."""
    surface = pipe(5, -8, 8)
    rims = AllLoops().run(surface, part, 1.0)
    behind = BoundingBox().run(part, surface, TOLERANCE, 0.1, True)
    assert len(rims.loops) == 2
    mesh = ShortestPath().run(surface, Rims(rims.loops[:1]), behind, part, sample_intact(part, 5), TOLERANCE)
    assert open_edges(mesh.faces) == 0
