"""An order of places along a curve of Morton: neighbours on the curve are neighbours in space."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Ints

BITS = 21
"""Binary digits that each coordinate of a cell may have."""
SPREAD = (
    (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)  # fmt: skip
"""Steps that put two zeros between neighbouring binary digits: the shift, and the digits that stay."""


def encode_cells(cells: Ints) -> Ints:
    """Numbers (N,) of cells (N,3) along the curve. Coordinates are from 0 to below 2**`BITS`."""
    code = np.zeros(len(cells), np.int64)
    for axis in range(3):
        digits = cells[:, axis].astype(np.int64)
        for shift, mask in SPREAD:
            digits = (digits | (digits << shift)) & mask
        code |= digits << axis
    return code
