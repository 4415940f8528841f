"""Connected pieces of a cloud, against single linkage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.cluster.hierarchy import fcluster, linkage

from damageest.geometry.point_pieces import number_pieces


def same_groups(a: np.ndarray, b: np.ndarray) -> bool:
    return len(np.unique(np.column_stack([a, b]), axis=0)) == len(np.unique(a)) == len(np.unique(b))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("gap", [0.02, 0.08, 0.15, 0.4])
def test_as_single_linkage(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    count = (40, 400)[seed % 2]
    points = rng.uniform(size=(count, 3)) * (1, 1, (1, 0.05, 0)[seed % 3])
    expected = fcluster(linkage(points, "single"), gap, "distance")
    assert same_groups(number_pieces(points, gap), expected)


def test_the_gap_itself_is_bridged_and_more_is_not() -> None:
    line = np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)])
    assert number_pieces(line, 1.0).max() == 0
    assert number_pieces(line, 0.99).max() == 49
    assert number_pieces(line[:1], 1.0).tolist() == [0]


def test_two_dense_clouds() -> None:
    points = np.random.default_rng(0).uniform(size=(200_000, 3))
    points[100_000:, 0] += 1.5
    piece = number_pieces(points, 0.3)
    assert set(piece[:100_000]) != set(piece[100_000:])
    assert piece.max() == 1
    assert number_pieces(points, 0.6).max() == 0
