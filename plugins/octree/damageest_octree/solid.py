"""Lost cells gathered into losses, and a closed surface round each loss."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Scan, Sites, Solid
from damageest_octree.classify import Cube, NodeFlags, label_components

LEAST_CELLS = 8
"""A component of fewer cells is noise."""


def find_losses(cube: Cube, flags: NodeFlags, aligned: Scan, sites: Sites) -> list[tuple[Ints, tuple[int, ...]]]:
    """The nodes and the sites of each loss: connected lost nodes, in large enough number, that damaged points touch.

    Components that share a site, or whose boxes overlap, are one loss: enclosures must not overlap.
    """
    from scipy.sparse.csgraph import connected_components

    label = label_components(flags.tree, flags.lost)
    count = int(label.max(initial=-1)) + 1
    touch = np.zeros((count, sites.count + 1), bool)
    members = np.flatnonzero(sites.label > 0)
    cells = cube.find_cells(aligned.points[members])
    step = np.arange(-1, 2) * (flags.reach + 1)
    for offset in np.stack(np.meshgrid(step, step, step), axis=-1).reshape(-1, 3):
        found = label[flags.tree.locate(cells + offset)]
        touch[found[found >= 0], sites.label[members[found >= 0]]] = True
    is_lost = label >= 0
    size = np.bincount(label[is_lost], weights=flags.tree.size[is_lost].astype(float) ** 3, minlength=count)
    kept = np.flatnonzero(touch.any(axis=1) & (size >= LEAST_CELLS))
    if not len(kept):
        return []
    nodes = [np.flatnonzero(label == k) for k in kept]
    low, high = np.moveaxis(np.array([_find_box(flags, own) for own in nodes]), 1, 0)
    near = (low[:, None] <= high[None]).all(axis=2)
    near = (near & near.T) | (touch[kept] @ touch[kept].T)
    number, owner = connected_components(near, directed=False)
    losses = []
    for own in (np.flatnonzero(owner == k) for k in range(number)):
        named = np.flatnonzero(touch[kept[own]].any(axis=0))
        losses.append((np.concatenate([nodes[j] for j in own]), tuple(int(site) for site in named)))
    return losses


def count_box_cells(flags: NodeFlags, nodes: Ints) -> int:
    """How many cells the grid has in which `close_loss` works."""
    low, high = _find_box(flags, nodes)
    return int(np.prod(high - low))


def _find_box(flags: NodeFlags, nodes: Ints) -> tuple[Ints, Ints]:
    """Lowest cell (3,) of the box round the nodes, and the cell (3,) after its highest, with a margin."""
    pad = flags.reach + 5
    low, size = flags.tree.low[nodes], flags.tree.size[nodes, None]
    return low.min(axis=0) - pad, (low + size).max(axis=0) + pad


def close_loss(cube: Cube, flags: NodeFlags, nodes: Ints) -> Solid | None:
    """The solid round the loss of these nodes; None where it has no volume. Outside the part it reaches two cells into
    the void.

    Noise makes the shell of damaged points two or three cells thick. The level set of the averaged cells runs through
    the middle of the shell; the faces of the cells would lie half its thickness off. One cell outside the intact skin
    counts as full too.
    """
    from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter

    from damageest.geometry.isosurface import extract_region
    from damageest.geometry.poisson import Grid

    low, high = _find_box(flags, nodes)
    shape = high - low
    at = np.empty(tuple(shape), np.int32)
    rows = np.stack(np.meshgrid(*(np.arange(n) for n in shape[1:]), indexing="ij"), axis=-1).reshape(-1, 2)
    for slab in range(int(shape[0])):
        cells = np.column_stack([np.full(len(rows), slab), rows]) + low
        at[slab] = flags.tree.locate(cells).reshape(tuple(shape[1:]))
    own = np.zeros(len(flags.tree.start), bool)
    own[nodes] = True
    full = np.where(flags.void, 0, 1).astype(np.float32)[at]
    # The cells that the closing added count to the nearer side.
    closing = flags.closing[at]
    to_void = distance_transform_edt(~flags.void[at]).astype(np.float32)
    to_full = distance_transform_edt((flags.void | flags.closing)[at]).astype(np.float32)
    full[closing] = np.where(to_void < to_full, 0, np.where(to_void > to_full, 1, 0.5))[closing]
    full[flags.shell[at]] = 0.5
    pushed = binary_dilation(flags.intact[at], np.ones((3, 3, 3), bool)) & ~(flags.in_part | flags.skin)[at]
    full[pushed] = 1
    mean = gaussian_filter(full, 1.0, mode="nearest")
    distance = distance_transform_edt(~own[at]).astype(np.float32)
    field = np.minimum(0.5 - mean, 0.25 * (flags.reach + 2.5 - distance))
    origin: Floats = cube.find_centres(low)
    x, y, z = (int(n) for n in shape)
    return extract_region(Grid(origin, cube.cell, (x, y, z)), field)
