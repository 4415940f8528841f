"""Vectors in rows."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats


def normalise(vectors: Floats, least: float = 1e-300) -> Floats:
    """(...,3) the vectors scaled to length 1; 0 stays 0, and one shorter than ``least``, which is rounding, short."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), least))
