"""The side of an inner damage surface on which metal was lost."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.geometry.threads import count_threads, cut_evenly
from damageest.geometry.vectors import normalise
from damageest.geometry.voxels import number_cubes

SMOOTH = 0.8
"""Agreement of the normals of two neighbours (0 to 1) above which they belong to one smooth patch."""
HINT = 0.01
"""Length of a hint that decides only where no skin is missing."""
CACHED = 30_000
"""Pairs of a point and a sample of the skin that are computed at a time, so that they stay in the processor's cache."""


def turn_toward_void(
    points: Floats, normals: Floats, above: Floats, lost: Floats, lost_normals: Floats, areas: Floats, cell: float
) -> Floats:
    """Normals (N,3) with their signs chosen so that they point to the side where metal was lost.

    For each point, the missing skin is added up as solid angle times direction; the sum points to the lost side. Skin
    that faces the other way, behind a void, cancels out. The signs of neighbours are coupled: within smooth patches,
    and between patches over all pairs of points along their border. The relative sign of two neighbours is that of
    Koenig and Gumhold 2009.

    Args:
        points: (N,3) on the inner damage surface.
        normals: (N,3) unit normals of either sign.
        above: (N,3) hint of the lost side, as the normal of the nominal skin nearest to each point. Its length, up to
            1, is its weight: with 1 it counts as much as skin that is missing all over the point, with `HINT` it
            decides where no skin is missing.
        lost, lost_normals: (S,3) samples of the missing skin, S may be 0, and its outward normals.
        areas: (S,) the area that each sample stands for, in the square of the points' unit.
        cell: length below which nothing is resolved.

    All are in one frame.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.empty((0, 3))
    viewpoints = points[pick_one_per_cube(points, 2 * cell)] if len(points) > 1500 else points
    toward_lost = _sum_solid_angles(viewpoints, lost, lost_normals, areas, cell) + _sum_missed_above(
        viewpoints, lost, lost_normals, areas, cell
    )
    nearest = cKDTree(viewpoints).query(points, workers=count_threads())[1]
    evidence = np.einsum("ij,ij->i", normals, toward_lost[nearest] / np.pi + above)
    return find_signs(points, normals, evidence)[:, None] * normals


def find_signs(points: Floats, normals: Floats, evidence: Floats) -> Floats:
    """Sign (N,) of each normal from its neighbours and from its own evidence (N,), which is positive where the normal
    points to the lost side."""
    if len(points) < 2:
        return np.where(evidence < 0, -1.0, 1.0)
    distance, index = find_neighbours(points, 11)
    first = np.repeat(np.arange(len(points)), index.shape[1] - 1)
    second = index[:, 1:].ravel()
    step = normalise(points[second] - points[first])
    # On a circular arc, and on both sides of a crease, the normal of one point, mirrored in the plane halfway between
    # the two, is that of the other; after Koenig and Gumhold (2009), who transport normals along curves.
    across = normals[first] - 2 * np.einsum("ij,ij->i", normals[first], step)[:, None] * step
    agree = np.einsum("ij,ij->i", across, normals[second])
    typical = max(float(np.median(distance[:, -1])), 1e-300)  # 0 where points coincide
    near = 1 / (1 + (distance[:, 1:].ravel() / typical) ** 2)

    # Patches are small, so that the few wrong couplings (across a thin fin, a narrow slot) are outweighed by the many
    # right ones along the borders.
    block = number_cubes(points, max(3 * typical, 1e-9 * float(np.ptp(points)), 1e-300))[1]
    strong = (np.abs(agree) > SMOOTH) & (block[first] == block[second])
    sign, patch = _span_trees(len(points), first[strong], second[strong], agree[strong])
    strength = near * agree * np.abs(agree)
    a, b = patch[first], patch[second]
    size = int(patch.max()) + 1
    total = _sum_couplings(size, a, b, strength * sign[first] * sign[second])
    patch_evidence = np.bincount(patch, evidence * sign, size)
    patch_sign = _relax_signs(total.tocsr(), np.asarray(patch_evidence, np.float64))
    links = _sum_couplings(len(points), first, second, strength).tocsr()
    return _flip_worst(sign * patch_sign[patch], links, np.zeros(len(points)), 5 * len(points) // 100)


def _relax_signs(links: Any, evidence: Floats) -> Floats:
    """Signs (P,) that agree best with links and evidence (P,): relaxed least squares, then single flips."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    strength = np.asarray(abs(links).sum(axis=1)).ravel()
    system = diags_array(strength + np.abs(evidence) + 1e-6 * (1 + strength.max(initial=0))) - links
    value = np.atleast_1d(spsolve(system.tocsc(), evidence))
    return _flip_worst(np.where(value < 0, -1.0, 1.0), links, evidence, 200)


def _flip_worst(sign: Floats, links: Any, evidence: Floats, most: int) -> Floats:
    """The signs after flipping those that contradict neighbours and evidence, worst first, at most ``most``."""
    sign = sign.copy()
    field = 0.5 * (links @ sign) + evidence
    for _ in range(most):
        worst = int(np.argmin(field * sign))
        if field[worst] * sign[worst] >= 0:
            break
        sign[worst] *= -1
        row = slice(links.indptr[worst], links.indptr[worst + 1])
        field[links.indices[row]] += links.data[row] * sign[worst]
    return sign


def _sum_couplings(size: int, a: Ints, b: Ints, strength: Floats) -> Any:
    """Symmetric couplings (size,size) between patches; those of one pair are added up."""
    from scipy.sparse import coo_array, csr_array

    apart = a != b
    one = csr_array(coo_array((strength[apart], (a[apart], b[apart])), shape=(size, size)))
    return (one + one.T).tocoo()


def _span_trees(size: int, first: Ints, second: Ints, agree: Floats) -> tuple[Floats, Ints]:
    """Signs (size,) along the spanning trees of the strongest agreements, 1 at each root, and the tree of each node
    (size,)."""
    from scipy.sparse import coo_array, csr_array
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    keys, where = np.unique(np.minimum(first, second) * size + np.maximum(first, second), return_index=True)
    a, b, c = keys // size, keys % size, agree[where]
    cost = 1.0 + 1e-9 - np.abs(c) / np.abs(c).max(initial=1e-300)
    tree = minimum_spanning_tree(csr_array(coo_array((cost, (a, b)), shape=(size, size)))).tocoo()
    at = np.searchsorted(keys, np.minimum(tree.row, tree.col).astype(np.int64) * size + np.maximum(tree.row, tree.col))
    edge_sign = np.where(c[at] < 0, -1.0, 1.0)
    count, island = connected_components(tree, directed=False)
    # Two nodes for each point, one per sign. A point has the sign of the root if its plus node is in one component with
    # the root's plus node.
    plus = edge_sign > 0
    i, j = tree.row, tree.col
    twice = coo_array(
        (
            np.ones(2 * len(i)),
            (np.concatenate([i, i + size]), np.concatenate([np.where(plus, j, j + size), np.where(plus, j + size, j)])),
        ),
        shape=(2 * size, 2 * size),
    )
    _, side = connected_components(twice, directed=False)
    root = np.zeros(count, np.int64)
    root[island[::-1]] = np.arange(size)[::-1]
    return np.where(side[:size] == side[root[island]], 1.0, -1.0), island.astype(np.int64)


def _softening(areas: Floats, cell: float) -> float:
    """Square of the distance within which samples of the skin do not resolve it as a surface."""
    return float(areas.mean() + (0.5 * cell) ** 2)


def _sum_missed_above(viewpoints: Floats, skin: Floats, normals: Floats, areas: Floats, cell: float) -> Floats:
    """The share (E,3) of skin close above a point that `_sum_solid_angles` misses, because samples do not resolve it.

    Under a disc of skin at height h, the softened sum is less than its true value pi by pi soft / (h^2 + soft). Without
    it, shallow wear all around a shaft would get its sign from the skin on the other side of the shaft.
    """
    from scipy.spatial import cKDTree

    if not len(skin):
        return np.zeros((len(viewpoints), 3))
    soft = _softening(areas, cell)
    nearest = cKDTree(skin).query(viewpoints, workers=count_threads())[1]
    step = skin[nearest] - viewpoints
    height = np.einsum("ij,ij->i", step, normals[nearest])
    beside = np.einsum("ij,ij->i", step, step) - height**2 > areas.mean()
    missing = np.where(beside, 0.0, np.pi * soft / (height**2 + soft))
    return np.asarray(missing[:, None] * normals[nearest])


def _sum_solid_angles(viewpoints: Floats, skin: Floats, normals: Floats, areas: Floats, cell: float) -> Floats:
    """Sum (E,3) over the skin samples of solid angle times direction, seen from each of the points (E,3)."""
    out = np.zeros((len(viewpoints), 3), np.float32)
    if not len(skin):
        return out.astype(np.float64)
    middle = skin.mean(axis=0)
    skin32, normals32 = (skin - middle).astype(np.float32), normals.astype(np.float32)
    weight = areas.astype(np.float32)
    soft = np.float32(_softening(areas, cell))
    size, turned = (skin32**2).sum(1), (normals32 * skin32).sum(1)

    for own in cut_evenly(len(viewpoints), max(1, CACHED // len(skin))):
        viewpoint = (viewpoints[own] - middle).astype(np.float32)
        # |s-q|^2 and n.(s-q) by matrix products: the sum over the skin never forms an (E,S,3) array
        square = (viewpoint**2).sum(1)[:, None] - 2 * viewpoint @ skin32.T
        square += size
        np.maximum(square, 0, out=square)
        square += soft
        share = turned - viewpoint @ normals32.T
        share *= weight
        share /= square
        share /= square
        out[own] = share @ skin32 - share.sum(1)[:, None] * viewpoint
    return out.astype(np.float64)
