"""Meshes that are nearly solids: safe repairs are made and reported, everything else is refused with the remedy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Solid, open_edges
from damageest.errors import InputError
from damageest.geometry.healing import heal
from tests.geometry.shapes import FAR, box, measure_volume

BOX = box()


def list_corners(mesh):
    """The mesh with vertices of its own for each triangle, as in an STL file."""
    return mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)


SPOILED = {
    "some windings": (
        np.where(np.isin(np.arange(12), [3, 7])[:, None], BOX.faces[:, ::-1], BOX.faces), "reversed 2 triangles",
    ),
    "a triangle missing": (BOX.faces[1:], "closed 1 small hole with 1 triangle"),
    "a repeated corner": (np.vstack([BOX.faces, [[0, 0, 1]]]), "dropped 1 triangles with a repeated corner"),
    "every face twice": (np.concatenate([BOX.faces] * 2), "dropped 12 triangles"),
    "both sides": (np.concatenate([BOX.faces, BOX.faces[:, ::-1]]), "dropped 12 triangles"),
}  # fmt: skip


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
@pytest.mark.parametrize("name", sorted(SPOILED))
def test_safe_repairs_restore_the_solid_and_say_so(name, away):
    faces, note = SPOILED[name]
    vertices, faces, notes = heal(BOX.vertices + away, faces)
    assert Solid(vertices, faces).volume == pytest.approx(1000)
    assert any(note in text for text in notes), notes


@given(seed=st.integers(0, 10**6), holes=st.integers(1, 8))
@settings(max_examples=12, deadline=None, derandomize=True)
def test_a_sphere_shuffled_jittered_turned_and_pierced_is_a_sphere_again(seed, holes):
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(3, radius=5)
    vertices, faces = list_corners(mesh)
    vertices = vertices + rng.uniform(-1e-7, 1e-7, vertices.shape)
    faces = rng.permutation(faces)[holes:]
    turned = rng.random(len(faces)) < 0.4
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    healed_vertices, healed_faces, notes = heal(vertices, faces)
    assert not open_edges(healed_faces)
    assert measure_volume(healed_vertices, healed_faces) == pytest.approx(mesh.volume, rel=0.01)
    assert len(notes) >= 2


def test_what_is_given_is_not_changed():
    vertices, faces = list_corners(BOX)
    kept = vertices.copy(), faces.copy()
    vertices.flags.writeable = faces.flags.writeable = False
    heal(vertices, faces[:, ::-1])
    np.testing.assert_array_equal(vertices, kept[0])
    np.testing.assert_array_equal(faces, kept[1])


def test_an_open_box_is_refused_with_count_place_and_remedy():
    faces = BOX.faces[BOX.cross[:, 2] < 1]
    with pytest.raises(InputError, match=r"^not watertight: 4 open edges.*, 5\).*Export the part again"):
        heal(BOX.vertices, faces)


def test_a_fin_on_a_box_is_refused_as_non_manifold():
    vertices = np.vstack([BOX.vertices, [[20.0, 0, 0]]])
    with pytest.raises(InputError, match="1 edges with more than two triangles"):
        heal(vertices, np.vstack([BOX.faces, [[*BOX.faces[0][:2], 8]]]))


def test_a_moebius_strip_is_refused_as_one_sided():
    n = 30
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    half = turn / 2
    rim = [
        np.column_stack(
            [(3 + s * np.cos(half)) * np.cos(turn), (3 + s * np.cos(half)) * np.sin(turn), s * np.sin(half)]
        )
        for s in (-1, 1)
    ]
    vertices = np.concatenate(rim)
    faces = []
    for i in range(n):
        a, b = i, i + n
        c, d = ((i + 1), (i + 1) + n) if i + 1 < n else (n, 0)
        faces += [[a, c, b], [b, c, d]]
    with pytest.raises(InputError, match="one-sided"):
        heal(vertices, np.array(faces))


def test_vertices_apart_by_rounding_are_merged_and_by_more_are_not():
    vertices, faces = list_corners(BOX)
    shift = np.random.default_rng(0).uniform(-1, 1, vertices.shape)
    healed, _, notes = heal(vertices + 2e-6 * shift, faces)
    assert len(healed) == 8
    assert "closer than" in notes[0]
    with pytest.raises(InputError):
        heal(vertices + 1e-2 * shift, faces)


def test_what_holds_no_mesh_is_refused():
    with pytest.raises(InputError, match="no triangles"):
        heal(BOX.vertices, np.empty((0, 3)))
    with pytest.raises(InputError, match="1 of its vertices are not finite"):
        heal(np.where(np.arange(8)[:, None] == 3, np.nan, BOX.vertices), BOX.faces)
    with pytest.raises(InputError, match="degenerate"):
        heal(BOX.vertices, np.array([[0, 1, 1]]))
