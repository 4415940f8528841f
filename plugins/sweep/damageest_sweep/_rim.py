"""The rim of a damage surface: gaps inside it filled, the surface carried on beyond it, its outline checked."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh


def filled(mesh: Mesh, rim: Ints) -> Mesh:
    """The mesh with every gap closed but the one that ``rim`` (N,) runs round: a star from the middle of its edge."""
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


def carried_on(mesh: Mesh, rim: Ints, way: Floats, by: float, steepest: float) -> tuple[Mesh, Ints]:
    """The mesh with a strip of width ``by`` along its rim (N,), and the new rim (N,).

    Damage is known from where it is a tolerance deep, so its surface ends below the skin. The strip goes on outward at
    the slope that the surface has there, ``steepest`` degrees at most; directions and slopes are averaged along the rim
    over the strip's width, so that the reconstruction's saw teeth do not fold it.
    """
    from scipy.ndimage import gaussian_filter1d

    if by == 0:
        return mesh, rim
    at = mesh.vertices[rim]
    step = float(np.median(np.linalg.norm(np.roll(at, -1, axis=0) - at, axis=1)))
    nodes = float(np.clip(by / max(step, 1e-300), 1, len(rim) / 12))

    def smooth(values: Floats) -> Floats:
        return np.asarray(gaussian_filter1d(values, nodes, axis=0, mode="wrap"))

    line = smooth(at)
    out = np.cross(np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0), way)
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    slope = smooth(mesh.vertex_cross[rim])
    angle = np.arctan2(-np.einsum("ij,ij->i", slope, out), np.maximum(slope @ way, 1e-300))
    angle = np.clip(angle, *np.deg2rad([-steepest, steepest]))[:, None]
    far = at + by * (np.cos(angle) * out + np.sin(angle) * way)
    new = np.arange(len(rim)) + len(mesh.vertices)
    after, new_after = np.roll(rim, -1), np.roll(new, -1)
    strip = [np.stack([after, rim, new], axis=1), np.stack([after, new, new_after], axis=1)]
    return Mesh(np.concatenate([mesh.vertices, far]), np.concatenate([mesh.faces, *strip])), new


def overlap(loop: Floats, way: Floats) -> float:
    """Share of the area within a loop (N,3), seen along ``way`` (3,), that it runs round more than once."""
    from manifold3d import CrossSection, FillRule

    across = np.linalg.svd(way[None])[2][1:]
    flat = (loop - loop.mean(axis=0)) @ across.T
    x, y = flat.T
    turned = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    if turned < 0:  # the two axes across the way may be left-handed
        flat, turned = flat[::-1], -turned
    covered = CrossSection([np.ascontiguousarray(flat)], FillRule.Positive).area()
    return float(1 - covered / turned)
