"""Rims follow the boundary edges of the surface."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.stages.boundary.all_loops import AllLoops
from tests.stages._open import bowl, pipe


def block(height: float) -> Part:
    """A block about the origin, its top at half the ``height``, or above it where a bowl hangs down from 0."""
    box = trimesh.creation.box((40, 30, 20 if height < 1 else height), np.eye(4))
    lift = -10 + height / 2 if height < 1 else 0.0
    return Part(np.add(box.vertices, (0, 0, lift)), box.faces)


def slit(ring: int, wide: int) -> np.ndarray:
    """The faces of a window between two rings of 96 vertices, ``wide`` vertices wide."""
    quads = ring * 192 + np.arange(wide)
    return np.concatenate([quads, quads + 96])


def list_directed_edges(faces: np.ndarray) -> set[tuple[int, int]]:
    return {(int(a), int(b)) for a, b in faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)}


def test_pipe_has_two_rims_along_its_own_edges() -> None:
    surface = pipe(5, -3, 3)
    rims = AllLoops().run(surface, block(6), 0.2).loops
    edges = list_directed_edges(surface.faces)
    assert [len(loop) for loop in rims] == [96, 96]
    heights = {float(surface.vertices[loop, 2][0]) for loop in rims}
    assert heights == {-3.0, 3.0}
    for loop in rims:
        assert len(set(loop.tolist())) == len(loop)
        for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True):
            assert (a, b) in edges
            assert (b, a) not in edges


def test_longest_first_and_short_loops_are_no_rims() -> None:
    surface = bowl(5, 0, 0.2)
    hole = np.flatnonzero((surface.faces == surface.faces[200, 0]).any(axis=1))
    gap = slit(8, 30)
    whole = np.delete(surface.faces, np.concatenate([hole, gap]), axis=0)
    torn = Surface(surface.vertices, whole)
    rims = AllLoops().run(torn, block(0.4), 1.0).loops
    assert len(rims) == 2
    assert len(rims[0]) == 96 > len(rims[1]) > 10
    # The same slit far below the skin is a gap of the scan and no rim.
    assert len(AllLoops().run(torn, block(0.4), 0.1).loops) == 1


def test_closed_surface_has_no_rim() -> None:
    surface = bowl(5, 0, 0.2)
    lid = np.stack([np.full(94, 2784 - 96), 2784 - 95 + np.arange(1, 95), 2784 - 95 + np.arange(94)], axis=1)
    assert len(surface.vertices) == 2784 + 1
    with pytest.raises(StageError, match="no rim"):
        AllLoops().run(Surface(surface.vertices, np.concatenate([surface.faces, lid])), block(6), 0.2)


def test_rims_that_touch_are_refused() -> None:
    surface = pipe(5, -3, 3)
    ring = 96 * 28
    hole = np.flatnonzero(((surface.faces >= ring) & (surface.faces < ring + 12)).any(axis=1))
    near_rim = hole[(surface.faces[hole] >= ring + 96).sum(axis=1) == 1]
    with pytest.raises(StageError, match="meet in a point"):
        AllLoops().run(Surface(surface.vertices, np.delete(surface.faces, near_rim[3], axis=0)), block(6), 0.2)
