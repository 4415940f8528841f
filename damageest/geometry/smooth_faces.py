"""Faces of a part that is a mesh: pieces of triangles that meet without an edge."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints


def label_smooth_faces(faces: Ints, normals: Floats, cosine: float) -> Ints:
    """(F,) the number, from 0, of the smooth piece that each triangle (F,3) belongs to.

    Neighbours are in one piece where the cosine of the angle between their unit ``normals`` (F,3) is above ``cosine``.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    key = edges[:, 0] * (int(faces.max(initial=-1)) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    triangle = order % max(len(faces), 1)
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = triangle[same], triangle[same + 1]
    smooth = np.einsum("ij,ij->i", normals[first], normals[second]) > cosine
    joined = coo_array((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(len(faces),) * 2)
    return np.asarray(connected_components(joined, directed=False)[1], np.int64)
