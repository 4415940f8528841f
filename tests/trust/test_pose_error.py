"""The error of the pose: as many repeated fits scatter, and its effect on a volume as a moved tool has it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import INTACT, Deviation, Floats, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_manifold, to_solid
from damageest.trust.interval.pose_error import PoseError, measure_pose_error
from tests import damaged_box

SIGMA, TOLERANCE = 0.05, 0.2


def cylinder() -> Part:
    mesh = trimesh.creation.cylinder(10, 40, sections=128)
    return Part(mesh.vertices, mesh.faces)


def measure(
    part: Part, count: int = 20_000, shift: Floats | float = 0.0, noise: float = SIGMA, **more: object
) -> PoseError:
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    points, _ = trimesh.sample.sample_surface(mesh, count, seed=1)
    points = points + shift + np.random.default_rng(1).normal(scale=noise, size=points.shape)
    distance, face = signed_distance(points, part)
    deviation = Deviation(distance, face, np.full(count, INTACT, np.uint8))
    scan = Scan(points, noise=SIGMA, spacing=0.5)
    return measure_pose_error(ScanField(part, scan, deviation, TOLERANCE), **more)  # type: ignore[arg-type]


def shift_errors(error: PoseError) -> Floats:
    return np.asarray(np.linalg.norm(error.spread[3:], axis=1))


def test_shift_of_a_box_is_as_exact_as_the_mean_of_its_faces() -> None:
    part, count = damaged_box.box(), 20_000
    x, y, z = damaged_box.SIZE
    faces = np.array([2 * y * z, 2 * x * z, 2 * x * y])
    expected = SIGMA / np.sqrt(count * faces / part.area)
    assert shift_errors(measure(part)) == pytest.approx(expected, rel=0.25)


def test_more_points_fix_the_pose_better() -> None:
    few, many = (shift_errors(measure(damaged_box.box(), count)) for count in (4000, 32_000))
    assert (many < 0.6 * few).all()


def test_a_pose_that_is_off_counts_with_what_it_is_off() -> None:
    assert measure(damaged_box.box()).spread.shape == (6, 6)
    off = measure(damaged_box.box(), shift=np.array([0.04, 0.0, 0.0]))
    assert off.spread.shape == (6, 7)
    assert off.spread[3:, 6] == pytest.approx([0.04, 0, 0], abs=0.005)


def test_a_direction_that_nothing_fixes_is_off_by_a_tolerance_and_changes_no_volume() -> None:
    part = cylinder()
    error = measure(part)
    about_axis = float(np.linalg.norm(error.spread[2]))
    assert about_axis * part.diagonal / 4 == pytest.approx(TOLERANCE, rel=0.35)
    ring = part.triangles.mean(axis=1)
    some = ring[:, 0] > 5
    areas = np.linalg.norm(part.cross[some], axis=1) / 2
    turning = PoseError(error.centre, error.spread * np.array([[0], [0], [1], [0], [0], [0]]), 0.0, 1.0)
    off = turning.of_volume(ring[some], part.face_normals[some], areas)
    assert np.abs(off).max() < 1e-6 * areas.sum()


def test_form_of_the_skin_is_systematic_and_noise_is_not() -> None:
    part = damaged_box.box()
    assert measure(part).systematic < 0.06 * SIGMA
    assert measure(part, form=0.03).systematic == 0.03
    assert 0.008 < measure_wavy(part, 3.5).systematic < 0.04


def test_the_area_that_deviates_alike_follows_the_waves() -> None:
    part = damaged_box.box()
    patch = measure(part).patch_area
    short, long = measure_wavy(part, 1.5), measure_wavy(part, 8.0)
    assert short.patch_area < 2 * patch
    assert long.patch_area > 4 * patch


def measure_wavy(part: Part, length: float) -> PoseError:
    """The skin is wavy, with a wavelength of 2 pi times ``length``."""
    mesh = trimesh.Trimesh(part.vertices, part.faces)
    points, index = trimesh.sample.sample_surface(mesh, 20_000, seed=1)
    wave = 0.04 * np.sin(points[:, :1] / length) * np.cos(points[:, 1:2] / length)
    points = points + wave * mesh.face_normals[index] + np.random.default_rng(0).normal(scale=SIGMA, size=points.shape)
    distance, face = signed_distance(points, part)
    deviation = Deviation(distance, face, np.zeros(len(points), np.uint8))
    return measure_pose_error(ScanField(part, Scan(points, noise=SIGMA, spacing=0.5), deviation, TOLERANCE))


def test_too_few_points_leave_a_tolerance_to_every_direction() -> None:
    assert shift_errors(measure(damaged_box.box(), 60)) == pytest.approx([TOLERANCE] * 3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_volume_changes_as_that_of_a_moved_tool(axis: int) -> None:
    part = damaged_box.box()
    ball = trimesh.creation.icosphere(5, 6.0)

    def remove(at: Floats) -> object:
        return to_solid(to_manifold(part) ^ to_manifold(Part(ball.vertices + at, ball.faces)))

    at, step = np.array([18.0, 2.0, 9.0]), 1e-3
    damage, moved = remove(at), remove(at + step * np.eye(3)[axis])
    inner = find_inner_faces(damage, part)  # type: ignore[arg-type]
    spread = np.zeros((6, 1))
    spread[3 + axis] = step
    own = damage.triangles[~inner].mean(axis=1)  # type: ignore[attr-defined]
    areas = np.linalg.norm(damage.cross[~inner], axis=1) / 2  # type: ignore[attr-defined]
    change = PoseError(np.zeros(3), spread, 0.0, 1.0).of_volume(own, damage.face_normals[~inner], areas)  # type: ignore[attr-defined]
    assert change[0] == pytest.approx(moved.volume - damage.volume, rel=0.01, abs=1e-4)  # type: ignore[attr-defined]


def test_a_footprint_shares_the_error_as_far_as_it_is_alike() -> None:
    """Over a square whose errors are alike within an edge, the mean of the correlation is that of the exact integral;
    over one that is small against the edge, all of the error is common."""
    error = PoseError(np.zeros(3), np.eye(6), 0.1, 1.0, alike=np.array([0.0]), edge=1.0)
    places, areas = np.random.default_rng(0).uniform(size=(5000, 3)) * [1, 1, 0], np.ones(5000)
    assert error.measure_common(0.01 * places, areas) > 0.99
    apart = np.linalg.norm(np.diff((10 * places).reshape(-1, 2, 3), axis=1)[:, 0], axis=1)
    exact = float(np.sqrt(np.clip(1 - apart, 0, None).mean()))
    assert error.measure_common(10 * places, areas) == pytest.approx(exact, rel=0.25)
    assert PoseError(np.zeros(3), np.eye(6), 0.1, 1.0).measure_common(places, areas) == 1.0
