"""The symmetries of a part: all of them, no others, and poses of a scan that follow from them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

import damageest
from damageest.artefacts import Floats, Mesh, Scan
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import to_arrays
from damageest.geometry.transforms import move_points
from damageest.stages.align.surface.plane_grid import PartSurface
from damageest.stages.align.symmetry.prepare_part import PreparedPart, prepare_part


def prepare(body: Manifold) -> PreparedPart:
    vertices, faces = to_arrays(body)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return prepare_part(PartSurface(Mesh((vertices - (low + high) / 2) / np.linalg.norm(high - low), faces)), 0)


def find(body: Manifold) -> tuple[Floats, Mesh]:
    part = prepare(body)
    return part.symmetries, part.surface.mesh


def prism(sides: int) -> Manifold:
    return Manifold.cylinder(20, 15, circular_segments=sides)


BOX = Manifold.cube((40, 30, 20))
HOLE = Manifold.cylinder(30, 0.8, circular_segments=12)


@pytest.mark.parametrize(
    ("body", "is_mirrored"),
    [
        (BOX - HOLE.translate((5, 15, 0)), True),
        (BOX - HOLE.translate((5, 10, 0)), True),  # straight through: by the plane across its axis
        (BOX - HOLE.translate((5, 10, 15)), False),
        (prism(7) - HOLE.translate((0, 0, 15)), True),
    ],
)
def test_a_part_that_a_plane_mirrors_onto_itself_is_told_from_one_with_a_hole_elsewhere(
    body: Manifold, is_mirrored: bool
) -> None:
    assert prepare(body.rotate((0, 0, 31))).is_mirror_symmetric == is_mirrored


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("body", "count"),
    [
        (Manifold.cube((40, 30, 20)), 4),
        (Manifold.cube((30, 30, 20)), 8),
        (Manifold.cube((30, 30, 30)), 24),
        (prism(6), 12),
        (prism(60), 120),
        (Manifold.cube((40, 30, 20)) - Manifold.cube((5, 5, 5)), 1),
        (prism(60) - Manifold.cube((4, 4, 50)).translate((13, -2, 0)), 2),  # a keyway: one half turn is left
        (prism(60) - Manifold.cylinder(0.4, 0.04, circular_segments=8).translate((9, 3, 19.8)), 1),  # a tiny hole
    ],
)
def test_all_symmetries_of_a_part_are_found_and_no_others(body: Manifold, count: int) -> None:
    motions, mesh = find(body)
    assert len(motions) == count
    np.testing.assert_allclose(motions[0], np.eye(4), atol=1e-12)
    for motion in motions:
        assert distance_to_mesh(move_points(mesh.vertices, motion), mesh).max() < 2e-4
    apart = np.abs(motions[:, None] - motions[None]).max(axis=(2, 3)) + np.eye(count)
    assert apart.min() > 0.01


@pytest.mark.slow
def test_the_true_pose_of_a_prism_is_among_those_that_are_listed() -> None:
    body = prism(60)
    part = trimesh.Trimesh(*to_arrays(body))
    points, _ = trimesh.sample.sample_surface(part, 40_000, seed=2)
    points = points[np.linalg.norm(points - [15, 0, 20], axis=1) > 5]
    turn = Rotation.random(random_state=3).as_matrix()
    scan = points @ turn.T + [5, 6, 7]
    result = damageest.run({"version": 1, "tolerance": 0.02}, part=part, scan=Scan(scan))
    assert result.pose.alternatives is not None
    poses = [result.pose.T_part_scan, *result.pose.alternatives]
    assert len(poses) == 120
    assert min(np.abs(move_points(scan[::50], one) - points[::50]).max() for one in poses) < 0.02
