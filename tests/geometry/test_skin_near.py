"""Points on the skin near damage: all of that skin, and little else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from damageest.artefacts import Mesh, Part
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.refinement import halve_edges
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin_near import COARSER, NearCubes, find_cubes_near, sample_near
from tests.geometry.shapes import box, torus

TOLERANCE, RIM, EDGE = 0.1, 0.5, 4.0


def as_part(mesh: Mesh) -> Part:
    return Part(mesh.vertices, mesh.faces)


@pytest.mark.parametrize(
    "mesh", [box((60, 40, 20)), halve_edges(box((60, 40, 20)), 1.0), torus()], ids=["large faces", "small", "torus"]
)
def test_no_place_near_the_damage_is_far_from_a_point(mesh: Mesh) -> None:
    part, rng = as_part(mesh), np.random.default_rng(0)
    skin, _ = sample_by_area(part, 60_000, rng)
    centre = part.vertices[0]
    is_lost = np.linalg.norm(skin - centre, axis=1) < 2
    near, unseen = find_cubes_near(part, skin[is_lost], skin[is_lost], skin[~is_lost], EDGE)
    assert not len(unseen), "what is not seen is lost"
    fine = NearCubes.around(skin[is_lost], RIM)
    found = sample_near(part, near, fine, TOLERANCE)
    asked = near.holds(skin)
    assert asked[np.linalg.norm(skin - centre, axis=1) < EDGE].all()
    # at the border of the cubes the nearest point may lie beyond it
    inner = asked & (np.linalg.norm(skin - centre, axis=1) < EDGE - TOLERANCE)
    gap = cKDTree(found.points).query(skin[inner])[0]
    assert gap.max() <= found.spacing == COARSER * TOLERANCE
    close = np.linalg.norm(skin[inner] - centre, axis=1) < 2 + RIM - found.spacing
    assert gap[close].max() <= TOLERANCE, "about the damage the points are closer"
    assert near.holds(found.points).all()
    assert distance_to_mesh(found.points, part).max() < 1e-9
    assert found.face.max() < len(part.faces)
    np.testing.assert_allclose(found.normals, part.face_normals[found.face])
    needed = (fine.holds(skin) + ~fine.holds(skin) / COARSER**2)[asked].sum() / len(skin) * part.area / TOLERANCE**2
    assert len(found.points) < 4 * needed, "little more than that skin needs"


def test_skin_that_the_scan_does_not_show_is_near_where_it_begins_at_the_damage() -> None:
    part, rng = as_part(box((60, 40, 20))), np.random.default_rng(1)
    skin, _ = sample_by_area(part, 60_000, rng)
    is_lost = np.linalg.norm(skin - part.bounds[1], axis=1) < 2
    is_bare = (skin[:, 2] > 9.9) & (skin[:, 0] > -10)  # a strip of the top, from the damage on
    near, unseen = find_cubes_near(part, skin[is_lost], skin[is_lost], skin[~is_lost & ~is_bare], EDGE)
    assert near.holds(skin[is_bare]).all()
    assert cKDTree(unseen).query(skin[is_bare])[0].max() < EDGE
    assert (cKDTree(skin[is_bare]).query(unseen)[0] < EDGE).all()
    other, _ = find_cubes_near(part, skin[is_lost], skin[is_lost], skin[~is_lost], EDGE)
    assert not other.holds(skin[is_bare]).all()
