"""Places on triangles by the weights of their corners."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats


def find_barycentric(corners: Floats, places: Floats, clip: bool = True) -> Floats:
    """(N,3) the weights of the corners (N,3,3) of triangles at places (N,3) on them; with ``clip`` from 0 to 1, which
    they are but for rounding."""
    a, b, c = np.moveaxis(corners, 1, 0)
    u, v, w = b - a, c - a, places - a
    uu, uv, vv = (np.einsum("ij,ij->i", s, t) for s, t in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    size = np.maximum(uu * vv - uv**2, 1e-300)
    second, third = (vv * wu - uv * wv) / size, (uu * wv - uv * wu) / size
    weights = np.stack([1 - second - third, second, third], axis=1)
    return np.asarray(np.clip(weights, 0, 1) if clip else weights)
