"""One rim, the one with the most nodes."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Surface
from damageest.errors import StageError
from damageest.stages.boundary.all_loops import AllLoops
from damageest.stages.boundary.largest_loop import LargestLoop
from tests.stages._open import bowl, pipe
from tests.stages.boundary.test_all_loops import block, slit


def test_the_longest_of_two() -> None:
    surface = bowl(5, 0, 0.2)
    torn = Surface(surface.vertices, np.delete(surface.faces, slit(8, 30), axis=0))
    assert len(AllLoops().run(torn, block(0.4), 1.0).loops) == 2
    (rim,) = LargestLoop().run(torn).loops
    assert len(rim) == 96
    assert np.allclose(torn.vertices[rim, 2], -0.2)


def test_equal_loops_always_give_the_same() -> None:
    surface = pipe(5, -3, 3)
    shuffled = Surface(surface.vertices, np.random.default_rng(0).permutation(surface.faces))
    first, second = LargestLoop().run(surface).loops[0], LargestLoop().run(shuffled).loops[0]
    assert set(first.tolist()) == set(second.tolist())


def test_a_single_triangle_is_refused() -> None:
    with pytest.raises(StageError, match="no rim"):
        LargestLoop().run(Surface(np.eye(3), np.array([[0, 1, 2]])))
