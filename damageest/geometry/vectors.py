"""Vectors in rows."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats


def normalise(vectors: Floats) -> Floats:
    """(...,3) the vectors scaled to length 1; 0 stays 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))
