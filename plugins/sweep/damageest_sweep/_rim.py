"""The rim of a damage surface: fill the gaps inside it, extend the surface beyond it, check its outline."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.vectors import normalise


def fill_gaps(mesh: Mesh, rim: Ints) -> Mesh:
    """The mesh with every boundary loop closed except ``rim`` (N,): by a fan from the mean of the loop's nodes."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = len(mesh.vertices)
    code, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    gap = edges[~np.isin(code, back) & ~np.isin(code, rim * size + np.roll(rim, -1))]
    if not len(gap):
        return mesh
    nodes, at = np.unique(gap, return_inverse=True)
    at = at.reshape(-1, 2)
    links = coo_array((np.ones(len(at)), (at[:, 0], at[:, 1])), shape=(len(nodes),) * 2)
    count, group = connected_components(links, directed=False)
    middle = np.zeros((count, 3))
    np.add.at(middle, group, mesh.vertices[nodes])
    middle /= np.bincount(group)[:, None]
    star = np.stack([gap[:, 1], gap[:, 0], size + group[at[:, 0]]], axis=1)
    return Mesh(np.concatenate([mesh.vertices, middle]), np.concatenate([mesh.faces, star]))


def extend_rim(mesh: Mesh, rim: Ints, direction: Floats, width: float, steepest: float) -> tuple[Mesh, Ints]:
    """The mesh with a strip of ``width`` along its rim (N,), and the new rim (N,).

    A damage surface ends about a tolerance below the skin, because only deeper points count as damage. The strip
    continues it outward at the slope that it has at its rim, at most ``steepest`` degrees from the plane across
    ``direction`` (3,). Directions and slopes are averaged along the rim over the width of the strip, because the rim of
    a reconstruction is jagged and the strip would fold.
    """
    from scipy.ndimage import gaussian_filter1d

    if width == 0:
        return mesh, rim
    at = mesh.vertices[rim]
    step = float(np.median(np.linalg.norm(np.roll(at, -1, axis=0) - at, axis=1)))
    nodes = float(np.clip(width / max(step, 1e-300), 1, len(rim) / 12))

    def smooth_along_rim(values: Floats) -> Floats:
        return np.asarray(gaussian_filter1d(values, nodes, axis=0, mode="wrap"))

    line = smooth_along_rim(at)
    out = normalise(np.cross(np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0), direction))
    slope = smooth_along_rim(mesh.vertex_cross[rim])
    angle = np.arctan2(-np.einsum("ij,ij->i", slope, out), np.maximum(slope @ direction, 1e-300))
    angle = np.clip(angle, *np.deg2rad([-steepest, steepest]))[:, None]
    far = at + width * (np.cos(angle) * out + np.sin(angle) * direction)
    new = np.arange(len(rim)) + len(mesh.vertices)
    after, new_after = np.roll(rim, -1), np.roll(new, -1)
    strip = [np.stack([after, rim, new], axis=1), np.stack([after, new, new_after], axis=1)]
    return Mesh(np.concatenate([mesh.vertices, far]), np.concatenate([mesh.faces, *strip])), new


def measure_overlap(loop: Floats, direction: Floats) -> float:
    """Share of the area inside a closed loop (N,3), seen along ``direction`` (3,), that it encircles more than once."""
    from manifold3d import CrossSection, FillRule

    across = np.linalg.svd(direction[None])[2][1:]
    flat = (loop - loop.mean(axis=0)) @ across.T
    x, y = flat.T
    enclosed = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    if enclosed < 0:  # the two axes across the direction may be left-handed
        flat, enclosed = flat[::-1], -enclosed
    covered = CrossSection([np.ascontiguousarray(flat)], FillRule.Positive).area()
    return float(1 - covered / enclosed)
