"""The error of an inner surface: as theory says of noise, less with more points, more at a longer rim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Flags, Floats, Solid
from damageest.trust.interval.inner_surface import InnerSurface, measure_inner_surface

SIDE, DEPTH = 10.0, 5.0


def pit() -> tuple[Solid, Flags]:
    """A box-shaped pit below z = 0, and which of its faces are inside the part: all but the top."""
    mesh = trimesh.creation.box((SIDE, SIDE, DEPTH)).subdivide().subdivide().subdivide().subdivide()
    solid = Solid(mesh.vertices - [0, 0, DEPTH / 2], mesh.faces)
    return solid, solid.triangles[:, :, 2].mean(axis=1) < -1e-9


def lying_on(solid: Solid, inner: Flags, count: int, noise: float, seed: int = 0) -> Floats:
    """Points on the inner surface, with noise along its normal."""
    mesh = trimesh.Trimesh(solid.vertices, solid.faces[inner], process=False)
    points, face = trimesh.sample.sample_surface(mesh, count, seed=seed)
    rng = np.random.default_rng(seed)
    return np.asarray(points + rng.normal(scale=noise, size=(count, 1)) * mesh.face_normals[face])


def measure(count: int = 2000, noise: float = 0.05, tolerance: float = 0.2) -> InnerSurface:
    solid, inner = pit()
    spacing = float(np.sqrt(solid.area / count))
    found = measure_inner_surface(solid, inner, lying_on(solid, inner, count, noise), noise, spacing, tolerance)
    assert found is not None
    return found


def test_pit_has_inner_faces_with_the_area_of_walls_and_floor() -> None:
    solid, inner = pit()
    assert np.linalg.norm(solid.cross[inner], axis=1).sum() / 2 == pytest.approx(SIDE**2 + 4 * SIDE * DEPTH)


def test_noise_is_that_of_a_sum_over_independent_points() -> None:
    area, count, noise = SIDE**2 + 4 * SIDE * DEPTH, 2000, 0.05
    assert measure(count, noise).noise == pytest.approx(noise * area / np.sqrt(count), rel=0.1)
    # the same, from points: the mean height over the surface times its area
    rng = np.random.default_rng(3)
    volumes = [area * rng.normal(scale=noise, size=count).mean() for _ in range(400)]
    assert measure(count, noise).noise == pytest.approx(float(np.std(volumes)), rel=0.15)


@pytest.mark.parametrize("name", ["noise", "depth"])
def test_errors_grow_with_the_noise(name: str) -> None:
    values = [getattr(measure(noise=noise), name) for noise in (0.01, 0.05, 0.2)]
    assert values == sorted(values)
    assert values[0] < values[-1]


@pytest.mark.parametrize("name", ["noise", "spacing", "depth", "gap"])
def test_errors_shrink_with_the_density(name: str) -> None:
    values = [getattr(measure(count), name) for count in (500, 2000, 8000)]
    assert values == sorted(values, reverse=True)
    assert values[0] > 1.5 * values[-1]


def test_rim_counts_in_squares_of_the_tolerance() -> None:
    assert measure(tolerance=0.4).rim == pytest.approx(4 * measure(tolerance=0.2).rim)


def test_gap_is_the_edge_of_the_square_for_each_point() -> None:
    assert measure(3000).gap == pytest.approx(np.sqrt((SIDE**2 + 4 * SIDE * DEPTH) / 3000))


def test_uneven_density_has_more_noise_than_an_even_one() -> None:
    solid, inner = pit()
    points = lying_on(solid, inner, 4000, 0.0)
    sparse = np.random.default_rng(0).random(4000) < np.where(points[:, 0] < 0, 0.1, 0.9)
    even = points[::2][: sparse.sum()]
    both = [measure_inner_surface(solid, inner, some, 0.05, 0.3, 0.2) for some in (points[sparse], even)]
    assert both[0] is not None
    assert both[1] is not None
    assert both[0].noise > 1.2 * both[1].noise * np.sqrt(len(even) / sparse.sum())


def test_nothing_is_known_without_points() -> None:
    solid, inner = pit()
    assert measure_inner_surface(solid, inner, np.empty((0, 3)), 0.05, 0.3, 0.2) is None
    assert (
        measure_inner_surface(solid, np.zeros(len(inner), bool), lying_on(solid, inner, 9, 0), 0.05, 0.3, 0.2) is None
    )


def test_values_are_plain_numbers() -> None:
    assert all(isinstance(value, float) for value in vars(replace(measure())).values())
