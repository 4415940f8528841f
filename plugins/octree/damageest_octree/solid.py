"""From the cells that are gone to a closed surface round them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Scan, Sites, Solid
from damageest_octree.sides import Cube, Sides, components

LEAST = 8
"""Cells below which a component is noise."""


def losses(cube: Cube, sides: Sides, aligned: Scan, sites: Sites) -> list[tuple[Ints, tuple[int, ...]]]:
    """The nodes and sites of each loss: of what is gone, the components of some size that damaged points touch.

    Components that share a site, or whose surroundings overlap, are one loss: enclosures are disjoint.
    """
    from scipy.sparse.csgraph import connected_components

    label = components(sides.tree, sides.gone)
    count = int(label.max(initial=-1)) + 1
    touch = np.zeros((count, sites.count + 1), bool)
    members = np.flatnonzero(sites.label > 0)
    cells = cube.cells(aligned.points[members])
    step = np.arange(-1, 2) * (sides.reach + 1)
    for offset in np.stack(np.meshgrid(step, step, step), axis=-1).reshape(-1, 3):
        found = label[sides.tree.locate(cells + offset)]
        touch[found[found >= 0], sites.label[members[found >= 0]]] = True
    gone = label >= 0
    size = np.bincount(label[gone], weights=sides.tree.size[gone].astype(float) ** 3, minlength=count)
    kept = np.flatnonzero(touch.any(axis=1) & (size >= LEAST))
    if not len(kept):
        return []
    nodes = [np.flatnonzero(label == k) for k in kept]
    low, high = np.moveaxis(np.array([_box(sides, own) for own in nodes]), 1, 0)
    near = (low[:, None] <= high[None]).all(axis=2)
    near = (near & near.T) | (touch[kept] @ touch[kept].T)
    number, owner = connected_components(near, directed=False)
    out = []
    for own in (np.flatnonzero(owner == k) for k in range(number)):
        named = np.flatnonzero(touch[kept[own]].any(axis=0))
        out.append((np.concatenate([nodes[j] for j in own]), tuple(int(site) for site in named)))
    return out


def box_cells(sides: Sides, nodes: Ints) -> int:
    """Cells of the box that `closed` works in."""
    low, high = _box(sides, nodes)
    return int(np.prod(high - low))


def _box(sides: Sides, nodes: Ints) -> tuple[Ints, Ints]:
    pad = sides.reach + 5
    low, size = sides.tree.low[nodes], sides.tree.size[nodes, None]
    return low.min(axis=0) - pad, (low + size).max(axis=0) + pad


def closed(cube: Cube, sides: Sides, nodes: Ints) -> Solid | None:
    """The loss of these nodes as a solid, open to the void outside by two cells.

    The level of the cells' mean runs through the middle of the shell of points, whose two or three cells of thickness
    noise makes; the cells' own faces would lie half a shell off. Sound skin counts as full one cell outward.
    """
    from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter

    from damageest.geometry.isosurface import extract_region
    from damageest.geometry.poisson import Grid

    low, high = _box(sides, nodes)
    shape = high - low
    at = np.empty(tuple(shape), np.int32)
    rows = np.stack(np.meshgrid(*(np.arange(n) for n in shape[1:]), indexing="ij"), axis=-1).reshape(-1, 2)
    for slab in range(int(shape[0])):
        cells = np.column_stack([np.full(len(rows), slab), rows]) + low
        at[slab] = sides.tree.locate(cells).reshape(tuple(shape[1:]))
    own = np.zeros(len(sides.tree.start), bool)
    own[nodes] = True
    full = np.where(sides.void, 0, 1).astype(np.float32)[at]
    # The closing is no shell of its own: its cells belong to whichever side is nearer.
    closing = sides.closing[at]
    to_void = distance_transform_edt(~sides.void[at]).astype(np.float32)
    to_full = distance_transform_edt((sides.void | sides.closing)[at]).astype(np.float32)
    full[closing] = np.where(to_void < to_full, 0, np.where(to_void > to_full, 1, 0.5))[closing]
    full[sides.shell[at]] = 0.5
    sound = sides.sound[at]
    pushed = binary_dilation(sound, np.ones((3, 3, 3), bool)) & ~(sides.in_part | sides.skin)[at]
    full[pushed] = 1
    mean = gaussian_filter(full, 1.0, mode="nearest")
    away = distance_transform_edt(~own[at]).astype(np.float32)
    field = np.minimum(0.5 - mean, 0.25 * (sides.reach + 2.5 - away))
    origin: Floats = cube.centres(low)
    x, y, z = (int(n) for n in shape)
    return extract_region(Grid(origin, cube.cell, (x, y, z)), field)
