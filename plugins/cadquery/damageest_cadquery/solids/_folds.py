"""Triangles that lie on others of their face, turned over: the mesher leaves some where an edge has no length."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Ints


def drop_folds(faces: Ints, number: Ints) -> Ints:
    """The triangles without pairs of one face that have the same corners in opposite order. ``number`` (F,): the face
    that each belongs to."""
    smallest = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (smallest[:, None] + np.arange(3)) % 3, axis=1)
    forward = turned[:, 1] < turned[:, 2]
    keys = np.column_stack([turned[:, 0], np.sort(turned[:, 1:], axis=1), number])
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.reshape(-1)
    there, back = np.bincount(group[forward], minlength=len(faces)), np.bincount(group[~forward], minlength=len(faces))
    folded = (there == 1) & (back == 1)
    return np.asarray(faces[~folded[group]])
