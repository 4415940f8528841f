"""The linear octree: its codes, its partition of the cube, and the cells that triangles touch."""

from __future__ import annotations

import igl
import numpy as np
import pytest
from damageest_octree.tree import build_tree, decode, dilate, encode, find_touched_cells
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays


@given(arrays(np.int64, st.tuples(st.integers(1, 40), st.just(3)), elements=st.integers(0, 2**21 - 1)))
@settings(deadline=None)
def test_morton_codes_interleave_the_bits_and_come_back(cells: np.ndarray) -> None:
    codes = encode(cells)
    assert np.array_equal(decode(codes), cells)
    for cell, code in zip(cells[:3].tolist(), codes[:3].tolist(), strict=True):
        assert code == sum((cell[axis] >> bit & 1) << (3 * bit + axis) for bit in range(21) for axis in range(3))


@given(arrays(np.int64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.integers(0, 15)))
@settings(max_examples=40, deadline=None)
def test_the_tree_partitions_its_cube_and_finds_neighbours(cells: np.ndarray) -> None:
    tree = build_tree(encode(cells), 4)
    node = np.full((16, 16, 16), -1)
    for number, (low, size) in enumerate(zip(tree.low, tree.size, strict=True)):
        x, y, z = (slice(a, a + size) for a in low)
        assert (node[x, y, z] == -1).all()
        node[x, y, z] = number
    assert (node >= 0).all()
    every = np.argwhere(node >= 0)
    assert np.array_equal(tree.locate(every), node[tuple(every.T)])
    assert (tree.size[tree.locate(cells)] == 1).all()
    pairs = [np.stack([np.delete(node, 15, a).ravel(), np.delete(node, 0, a).ravel()], axis=1) for a in range(3)]
    sides = np.concatenate(pairs)
    assert _undirect(tree.pair_neighbours()) == _undirect(sides[sides[:, 0] != sides[:, 1]])


def _undirect(pairs: np.ndarray) -> set[tuple[int, int]]:
    return set(map(tuple, np.sort(pairs, axis=1).tolist()))


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_touched_cells_are_those_that_the_triangles_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(1, 31, (4, 3, 3))
    found = {tuple(cell) for cell in find_touched_cells(triangles, 5).tolist()}
    weights = rng.dirichlet(np.ones(3), 4000)
    on = np.einsum("pk,fkj->fpj", weights, triangles).reshape(-1, 3)
    assert set(map(tuple, np.floor(on).astype(int).tolist())) <= found
    centres = np.array(sorted(found)) + 0.5
    squared = igl.point_mesh_squared_distance(centres, triangles.reshape(-1, 3), np.arange(12).reshape(4, 3))[0]
    assert squared.max() <= 0.75 + 1e-6


def test_dilation_takes_all_within_reach() -> None:
    assert len(dilate(np.array([[9, 9, 9]]), 2)) == 5**3
    assert dilate(np.array([[0, 5, 5]]), 1).min(axis=0).tolist() == [0, 4, 4]
