"""Cuts triangles along the zero line of a field."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints


def cut_triangles(vertices: Floats, faces: Ints, value: Floats) -> tuple[Floats, Ints, Ints, Flags]:
    """Cuts triangles where a field ``value`` (V,), linear on each, changes its sign. Neighbours stay connected.

    Returns:
        Vertices, faces, the original face of each, and whether the field is positive on it.
    """
    sign = np.sign(value)[faces]
    crossed = (sign.max(axis=1) > 0) & (sign.min(axis=1) < 0)
    whole = np.flatnonzero(~crossed)
    cut = np.flatnonzero(crossed)
    touching = (sign[cut] == 0).any(axis=1)
    # corners are rotated so that the one on the plane, or the only one on its side, comes first
    lone = np.where(touching[:, None], sign[cut] == 0, sign[cut] == -np.sign(sign[cut].sum(axis=1))[:, None])
    turn = (lone.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces[cut], turn, axis=1).T
    first, last = np.where(touching, b, a), np.where(touching, c, b)
    pairs = np.concatenate([np.stack([first, last], 1), np.stack([a, c], 1)[~touching]])
    edges, number = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    low, high = edges.T
    share = value[low] / np.where(value[low] == value[high], 1, value[low] - value[high])
    fresh = vertices[low] + share[:, None] * (vertices[high] - vertices[low])
    number = number.reshape(-1) + len(vertices)
    p, q = number[: len(cut)], np.zeros(len(cut), np.int64)
    q[~touching] = number[len(cut) :]
    two, three = np.flatnonzero(touching), np.flatnonzero(~touching)
    pieces = [
        (whole, faces[whole]),
        (cut[two], np.stack([a[two], b[two], p[two]], 1)),
        (cut[two], np.stack([a[two], p[two], c[two]], 1)),
        (cut[three], np.stack([a[three], p[three], q[three]], 1)),
        (cut[three], np.stack([p[three], b[three], c[three]], 1)),
        (cut[three], np.stack([p[three], c[three], q[three]], 1)),
    ]
    parent = np.concatenate([owner for owner, _ in pieces])
    out = np.concatenate([part for _, part in pieces])
    all_values = np.concatenate([value, np.zeros(len(fresh))])
    positive = all_values[out].sum(axis=1) > 0
    return np.concatenate([vertices, fresh]), out, parent, positive
