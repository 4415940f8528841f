"""Rows of vectors."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from damageest.geometry.vectors import normalise

SIZES = st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda value: value == 0 or abs(value) > 1e-6)


@given(arrays(np.float64, (5, 2, 3), elements=SIZES))
def test_rows_have_length_1_and_their_direction(vectors: np.ndarray) -> None:
    found, length = normalise(vectors), np.linalg.norm(vectors, axis=-1)
    assert found.shape == vectors.shape
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), length > 0, atol=1e-12)
    np.testing.assert_allclose(found * length[..., None], vectors, rtol=1e-12, atol=0)
