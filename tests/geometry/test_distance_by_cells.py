"""Distances that follow from a neighbour's triangle against those searched for one by one."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import Floats, Ints, Part
from damageest.geometry.distance import signed_distance
from damageest.geometry.distance_by_cells import signed_distance_by_cells


def around(part: Part, count: int, noise: float) -> Floats:
    """Points on the part with noise, every twentieth anywhere in its bounds."""
    rng = np.random.default_rng(3)
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    points = np.array(trimesh.sample.sample_surface(mesh, count, seed=5)[0]) + rng.normal(0, noise, (count, 3))
    low, high = part.bounds
    points[::20] = rng.uniform(low - 0.1 * part.diagonal, high + 0.1 * part.diagonal, (len(points[::20]), 3))
    return points


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", ["block", "gear", "half_torus", "tube", "blade"])
def test_distances_are_right_within_a_hundredth_of_them_and_exact_far_off(name: str) -> None:
    part = PARTS[name]()
    near = 7e-4 * part.diagonal
    points = around(part, 60_000, near / 4)
    searched = 0

    def exact(some: Floats) -> tuple[Floats, Ints]:
        nonlocal searched
        searched += len(some)
        return signed_distance(some, part)

    distance, face = signed_distance_by_cells(points, part, near, exact)
    right = signed_distance(points, part)[0]
    assert np.abs(distance - right).max() < 0.01 * near
    assert (distance == right)[np.abs(right) > 1.01 * near].all()
    assert searched < 0.8 * len(points)
    # the triangle is one whose plane is that far off
    cross = part.cross[face]
    height = np.einsum("ij,ij->i", points - part.triangles[face, 0], cross) / np.linalg.norm(cross, axis=1)
    close = np.abs(distance) < near
    assert (np.abs(height) <= np.abs(distance) + 1e-9 * part.diagonal)[close].all()


def test_faces_that_share_no_vertices_are_searched_one_by_one() -> None:
    part = PARTS["block"]()
    loose = Part.__new__(Part)
    for name, value in vars(part).items():
        object.__setattr__(loose, name, value)
    object.__setattr__(loose, "vertices", part.vertices[part.faces].reshape(-1, 3))
    object.__setattr__(loose, "faces", np.arange(3 * len(part.faces)).reshape(-1, 3))
    points = around(part, 20_000, 1e-4 * part.diagonal)
    near = 7e-4 * part.diagonal
    distance, _ = signed_distance_by_cells(points, loose, near, lambda some: signed_distance(some, part))
    assert np.abs(distance - signed_distance(points, part)[0]).max() < 0.01 * near
