"""The order along a curve of Morton: each cell has a number of its own, and blocks of cells stay together."""

from __future__ import annotations

import numpy as np

from damageest.geometry.morton import BITS, encode_cells


def test_numbers_interleave_the_digits_of_the_coordinates() -> None:
    assert encode_cells(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0], [3, 3, 3]])).tolist() == [1, 2, 4, 8, 63]
    cells = np.random.default_rng(0).integers(0, 2**BITS, (200, 3))
    for cell, code in zip(cells, encode_cells(cells), strict=True):
        bits = [(int(cell[axis]) >> bit & 1) << (3 * bit + axis) for bit in range(BITS) for axis in range(3)]
        assert sum(bits) == code


def test_a_block_of_cells_is_a_run_of_numbers() -> None:
    block = np.stack(np.meshgrid(*3 * [np.arange(8, 16)]), axis=-1).reshape(-1, 3)
    assert sorted(encode_cells(block)) == list(range(7 * 8**3, 8 * 8**3))
