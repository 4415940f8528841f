"""Which triangles form a body, which way they face, and what overlapping bodies become."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Mesh, Solid, open_edges
from damageest.errors import InputError
from damageest.geometry.body_repair import label_bodies, orient_faces, resolve_bodies, signed_volumes, split_pinches
from tests.geometry.shapes import FAR, ball, box, invert, join, torus

BODIES = {
    "inside out": (join(invert(box())), 1000, "reversed all triangles"),
    "two bodies": (join(box(), box(at=(30, 0, 0))), 2000, "2 separate bodies"),
    "one of them inside out": (join(box(), invert(box(at=(30, 0, 0)))), 2000, "reversed the triangles of 1 of 2"),
    "overlapping": (join(box(), box(at=(5, 1, 1))), 2000 - 5 * 9 * 9, "united 2 bodies"),
    "face to face": (join(box(), box(at=(10, 0, 0))), 2000, "united 2 bodies"),
    "one in the other": (join(box(), box(4)), 1000 - 64, "it counts as a cavity"),
    "overlapping, one of them inside out": (join(box(), invert(box(at=(5, 1, 1)))), 2000 - 5 * 9 * 9, "of 1 of 2"),
    "face to face, one of them inside out": (join(invert(box()), box(at=(10, 0, 0))), 2000, "of 1 of 2"),
    "the same twice, once inside out": (join(box(), invert(box())), 1000, "of 1 of 2"),
    "a pocket of its own shell": (join(box(), invert(box(4, at=(3, 0, 0)))), 1000 - 64, "united 2 bodies"),
    "a cavity": (join(box(), invert(box(4))), 1000 - 64, "1 inner cavity, kept"),
    "a cavity, all inside out": (join(invert(box()), box(4)), 1000 - 64, "reversed all triangles"),
    "an island in a cavity": (join(box(), invert(box(6)), box(2)), 1000 - 216 + 8, "1 inner cavity, kept"),
    "a flat body": (join(box(), Mesh(box().vertices * [1, 1, 0] + [30, 0, 0], box().faces)), 1000, "dropped 1 bodies"),
}


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
@pytest.mark.parametrize("name", sorted(BODIES))
def test_bodies_become_one_solid_and_notes_say_how(name: str, away: np.ndarray) -> None:
    (vertices, faces), volume, note = BODIES[name]
    notes: list[str] = []
    made = Solid(*resolve_bodies(vertices + away, faces, notes))
    assert made.volume == pytest.approx(volume)
    assert any(note in text for text in notes), notes


def test_a_body_within_a_body_of_a_cad_kernel_is_no_cavity() -> None:
    assert Solid(*resolve_bodies(*join(box(), box(4)), [], outward=True)).volume == pytest.approx(1000)
    assert Solid(*resolve_bodies(*join(box(), invert(box(4))), [], outward=True)).volume == pytest.approx(936)


def test_bodies_that_are_all_flat_are_refused() -> None:
    with pytest.raises(InputError, match="no volume"):
        resolve_bodies(box().vertices * [1, 1, 0], box().faces, [])


def test_bodies_are_labelled_and_their_volumes_have_signs() -> None:
    parts = [box(), invert(ball(4)), torus()]
    vertices, faces = join(*parts)
    label, count = label_bodies(faces)
    assert count == 3
    assert np.array_equal(label, np.repeat([0, 1, 2], [len(part.faces) for part in parts]))
    expected = [box().volume, -ball(4).volume, torus().volume]
    assert signed_volumes(vertices, faces, label, count) == pytest.approx(expected)
    # the sum over all of them does not depend on where the part lies
    assert signed_volumes(vertices + FAR, faces, label, count) == pytest.approx(expected)


@given(st.integers(0, 1000), st.floats(0, 0.45))
@settings(max_examples=25, deadline=None)
def test_windings_agree_again_and_the_fewer_triangles_are_reversed(seed: int, share: float) -> None:
    ring = torus()
    flip = np.random.default_rng(seed).random(len(ring.faces)) < share
    faces, reversed_count = orient_faces(np.where(flip[:, None], ring.faces[:, ::-1], ring.faces))
    assert open_edges(faces) == 0
    assert reversed_count == flip.sum()
    assert Solid(ring.vertices, faces).volume == pytest.approx(ring.volume)


def test_a_one_sided_strip_has_no_windings_that_agree() -> None:
    n, i = 30, np.arange(30)
    a, c = i, np.where(i + 1 < n, i + 1, n)
    b, d = i + n, np.where(i + 1 < n, i + 1 + n, 0)
    strip = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    faces, reversed_count = orient_faces(strip)
    assert reversed_count is None
    assert np.array_equal(faces, strip)


def test_boxes_that_share_an_edge_get_vertices_of_their_own() -> None:
    mesh = trimesh.util.concatenate([trimesh.creation.box((10,) * 3, np.eye(4)) for _ in range(2)])
    mesh.vertices[8:] += [10, 10, 0]
    mesh.merge_vertices()
    assert open_edges(mesh.faces)
    notes: list[str] = []
    made = Solid(*split_pinches(mesh.vertices, mesh.faces, notes))
    assert made.volume == pytest.approx(2000)
    assert len(made.vertices) == 16
    assert "doubled the vertices" in notes[0]
    open_box = box().faces[1:]
    assert split_pinches(box().vertices, open_box, notes)[1] is open_box
