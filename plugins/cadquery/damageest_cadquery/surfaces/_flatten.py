"""Maps an open surface of one rim onto a disk, so that one spline can follow it wherever it bends.

The rim goes to a circle by its length; inside, each vertex lies at a weighted mean of its neighbours, with positive
weights, so that no triangle folds: W. T. Tutte, "How to draw a graph", 1963; M. S. Floater, 1997.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import spsolve

from damageest.artefacts import Floats, Ints, Mesh
from damageest.errors import StageError
from damageest.geometry.edges import list_edges
from damageest.geometry.loops import trace_loops


def flatten(mesh: Mesh) -> Floats | None:
    """(V,2) places in the unit disk; None where the surface is not one sheet. Of several rims, the longest is the
    circle's."""
    try:
        loops = trace_loops(mesh.faces)
    except StageError:  # two of them touch
        return None
    if not loops:
        return None
    lengths = [float(np.linalg.norm(mesh.vertices[k] - mesh.vertices[np.roll(k, 1)], axis=1).sum()) for k in loops]
    longest = int(np.argmax(lengths))
    closed = _close_holes(mesh, [loop for k, loop in enumerate(loops) if k != longest])
    edges = np.unique(list_edges(closed.faces), axis=0)
    if len(closed.vertices) - len(edges) + len(closed.faces) != 1:
        return None
    places = _flatten_disk(closed, loops[longest])
    return None if places is None else places[: len(mesh.vertices)]


def _close_holes(mesh: Mesh, loops: Sequence[Ints]) -> Mesh:
    """The surface with a fan of triangles over each loop."""
    if not loops:
        return mesh
    middles = np.array([mesh.vertices[loop].mean(axis=0) for loop in loops])
    fans = [
        np.column_stack([loop, np.roll(loop, -1), np.full(len(loop), len(mesh.vertices) + number)])
        for number, loop in enumerate(loops)
    ]
    return Mesh(np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, *fans]))


def _flatten_disk(mesh: Mesh, rim: Ints) -> Floats | None:
    if len(np.unique(rim)) != len(rim):
        return None
    steps = np.linalg.norm(mesh.vertices[rim] - mesh.vertices[np.roll(rim, 1)], axis=1)
    # the rim zigzags: its length counts, smoothed over neighbours
    steps = np.convolve(np.pad(steps, 7, mode="wrap"), np.ones(15) / 15, "valid")
    angle = 2 * np.pi * np.cumsum(steps) / steps.sum()
    disk = np.zeros((len(mesh.vertices), 2))
    disk[rim] = np.column_stack([np.cos(angle), np.sin(angle)])
    inner = np.ones(len(mesh.vertices), bool)
    inner[rim] = False
    W = _weigh(mesh)
    L = csr_array(diags_array(np.asarray(W.sum(axis=1)).ravel()) - W)
    rows = np.flatnonzero(inner)
    found = spsolve(L[rows][:, rows].tocsc(), -(L[rows][:, rim] @ disk[rim]))
    disk[rows] = found
    return disk


def _weigh(mesh: Mesh) -> csr_array:
    """(V,V) mean value weights: tangents of half the angles beside an edge over its length, all positive."""
    corners = mesh.triangles
    size = len(mesh.vertices)
    total = csr_array((size, size))
    for k in range(3):
        at, after, before = corners[:, k], corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        a, b = after - at, before - at
        long_a, long_b = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        cosine = np.einsum("ij,ij->i", a, b) / np.maximum(long_a * long_b, 1e-300)
        half = np.sqrt(np.clip((1 - cosine) / np.maximum(1 + cosine, 1e-12), 1e-12, 1e6))
        i: Ints = mesh.faces[:, k]
        for other, length in ((mesh.faces[:, (k + 1) % 3], long_a), (mesh.faces[:, (k + 2) % 3], long_b)):
            weight = half / np.maximum(length, 1e-12 * mesh.diagonal)
            total = total + coo_array((weight, (i, other)), shape=(size, size)).tocsr()
    return total
