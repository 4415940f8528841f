"""Boundary loops of open meshes whose boundary is known."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Surface
from damageest.errors import StageError
from damageest.geometry.loops import MOST_FLAW_VERTICES, trace_loops, trace_rims
from tests.geometry.shapes import torus
from tests.stages._open import bowl, pipe


def test_an_open_tube_has_two_loops_in_the_direction_of_its_faces() -> None:
    tube = pipe(5, -3, 3)
    loops = trace_loops(np.random.default_rng(0).permutation(tube.faces))
    assert [len(set(loop.tolist())) for loop in loops] == [96, 96]
    assert {height for loop in loops for height in tube.vertices[loop, 2]} == {-3.0, 3.0}
    edges = {tuple(edge) for edge in tube.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    for loop in loops:
        assert set(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)) <= edges


def test_closed_and_empty_meshes_have_none() -> None:
    assert trace_loops(torus().faces) == []
    assert trace_loops(np.empty((0, 3), np.int64)) == []


def test_the_longest_loop_comes_first() -> None:
    surface = bowl(5, 0, 0.2)
    hole = np.flatnonzero((surface.faces == surface.faces[200, 0]).any(axis=1))
    loops = trace_loops(np.delete(surface.faces, hole, axis=0))
    assert [len(loop) for loop in loops] == [96, 6]


def test_small_loops_are_flaws_and_no_rims() -> None:
    surface = bowl(5, 0, 0.2)
    hole = np.flatnonzero((surface.faces == surface.faces[200, 0]).any(axis=1))
    (rim,) = trace_rims(Surface(surface.vertices, np.delete(surface.faces, hole, axis=0)))
    assert len(rim) == 96
    with pytest.raises(StageError, match=f"no rim.* more than {MOST_FLAW_VERTICES} vertices"):
        trace_rims(Surface(surface.vertices, surface.faces[hole]))


def test_loops_that_meet_in_a_vertex_are_refused() -> None:
    with pytest.raises(StageError, match="meet in a point"):
        trace_loops(np.array([[0, 1, 2], [0, 3, 4]]))
