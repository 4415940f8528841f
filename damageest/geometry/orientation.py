"""Which side of an inner damage surface the metal was lost on."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.geometry.voxels import number_cubes

SMOOTH = 0.8
"""Agreement of two neighbours above which they lie on the same smooth patch."""


def turn_toward_void(
    points: Floats, normals: Floats, above: Floats, lost: Floats, lost_normals: Floats, areas: Floats, cell: float
) -> Floats:
    """Turns normals (N,3) of either sign toward the lost side.

    Each point sees the skin that is gone under a solid angle, and its lost side is where that lies; skin that faces the
    other way, behind a void, cancels out. Neighbours agree on relative signs: within smooth patches, and between
    patches, where all the pairs along a border count together.

    Args:
        above: (N,3) normal of the nominal skin nearest to each point; it decides where no skin is gone.
        lost, lost_normals: (S,3) samples of the skin that is gone, each standing for one of the ``areas`` (S,).
        cell: length below which nothing is resolved.
    """
    from scipy.spatial import cKDTree

    eyes = points[pick_one_per_cube(points, 2 * cell)] if len(points) > 1500 else points
    pull = _pull(eyes, lost, lost_normals, areas, cell) + _pull_overhead(eyes, lost, lost_normals, areas, cell)
    nearest = cKDTree(eyes).query(points, workers=2)[1]
    vote = np.einsum("ij,ij->i", normals, pull[nearest] / np.pi + 0.01 * above)
    return _find_signs(points, normals, vote)[:, None] * normals


def _find_signs(points: Floats, normals: Floats, vote: Floats) -> Floats:
    """Sign (N,) of each normal, from the neighbours' and the votes."""
    distance, index = find_neighbours(points, 11)
    first = np.repeat(np.arange(len(points)), index.shape[1] - 1)
    second = index[:, 1:].ravel()
    step = points[second] - points[first]
    step /= np.maximum(np.linalg.norm(step, axis=1), 1e-300)[:, None]
    # Mirrored in the plane halfway between two points, the normal of one is that of the other on any circular arc, and
    # on either side of a crease; after Koenig and Gumhold (2009), who transport normals along curves.
    across = normals[first] - 2 * np.einsum("ij,ij->i", normals[first], step)[:, None] * step
    agree = np.einsum("ij,ij->i", across, normals[second])
    near = 1 / (1 + (distance[:, 1:].ravel() / np.median(distance[:, -1])) ** 2)

    # Small patches, so that the few wrong agreements (across a thin fin, a narrow slot) are outvoted along borders.
    block = number_cubes(points, max(3 * float(np.median(distance[:, -1])), 1e-9 * float(np.ptp(points)), 1e-300))[1]
    firm = (np.abs(agree) > SMOOTH) & (block[first] == block[second])
    sign, patch = _span_trees(len(points), first[firm], second[firm], agree[firm])
    strength = near * agree * np.abs(agree)
    a, b = patch[first], patch[second]
    size = int(patch.max()) + 1
    total = _sum_couplings(size, a, b, strength * sign[first] * sign[second])
    patch_vote = np.bincount(patch, vote * sign, size)
    patch_sign = _relax_signs(total.tocsr(), np.asarray(patch_vote, np.float64))
    links = _sum_couplings(len(points), first, second, strength).tocsr()
    return _flip_worst(sign * patch_sign[patch], links, np.zeros(len(points)), 5 * len(points) // 100)


def _relax_signs(links: Any, vote: Floats) -> Floats:
    """Signs (P,) that agree with links and votes as well as they can: least squares, relaxed, then single flips."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    strength = np.asarray(abs(links).sum(axis=1)).ravel()
    system = diags_array(strength + np.abs(vote) + 1e-6 * (1 + strength.max(initial=0))) - links
    value = np.atleast_1d(spsolve(system.tocsc(), vote))
    return _flip_worst(np.where(value < 0, -1.0, 1.0), links, vote, 200)


def _flip_worst(sign: Floats, links: Any, vote: Floats, most: int) -> Floats:
    """Flips, worst first, the signs that neighbours and vote contradict; ``most`` flips."""
    sign = sign.copy()
    field = 0.5 * (links @ sign) + vote
    for _ in range(most):
        worst = int(np.argmin(field * sign))
        if field[worst] * sign[worst] >= 0:
            break
        sign[worst] *= -1
        row = slice(links.indptr[worst], links.indptr[worst + 1])
        field[links.indices[row]] += links.data[row] * sign[worst]
    return sign


def _sum_couplings(size: int, a: Ints, b: Ints, strength: Floats) -> Any:
    """Symmetric couplings between patches, those of one pair added up."""
    from scipy.sparse import coo_array, csr_array

    apart = a != b
    one = csr_array(coo_array((strength[apart], (a[apart], b[apart])), shape=(size, size)))
    return (one + one.T).tocoo()


def _span_trees(size: int, first: Ints, second: Ints, agree: Floats) -> tuple[Floats, Ints]:
    """Signs along the spanning trees of the firmest agreements, 1 at each root, and the tree of each node."""
    from scipy.sparse import coo_array, csr_array
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    keys, where = np.unique(np.minimum(first, second) * size + np.maximum(first, second), return_index=True)
    a, b, c = keys // size, keys % size, agree[where]
    cost = 1.0 + 1e-9 - np.abs(c) / np.abs(c).max(initial=1e-300)
    tree = minimum_spanning_tree(csr_array(coo_array((cost, (a, b)), shape=(size, size)))).tocoo()
    at = np.searchsorted(keys, np.minimum(tree.row, tree.col).astype(np.int64) * size + np.maximum(tree.row, tree.col))
    edge_sign = np.where(c[at] < 0, -1.0, 1.0)
    count, island = connected_components(tree, directed=False)
    # Doubled nodes: one for each sign. A node and the root's plus side end up in one component where its sign is plus.
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


def _softness(areas: Floats, cell: float) -> float:
    """Square of the length below which skin samples stand for points and not for a surface."""
    return float(areas.mean() + (0.5 * cell) ** 2)


def _pull_overhead(eyes: Floats, skin: Floats, normals: Floats, areas: Floats, cell: float) -> Floats:
    """What `_pull` leaves out (E,3) of skin so close overhead that its samples do not resolve it.

    Under a disc of skin at height h the softened sum falls short of the whole, pi, by pi soft / (h^2 + soft): a shallow
    wear all round a shaft would otherwise be turned by the skin on the shaft's other side.
    """
    from scipy.spatial import cKDTree

    if not len(skin):
        return np.zeros((len(eyes), 3))
    soft = _softness(areas, cell)
    nearest = cKDTree(skin).query(eyes, workers=2)[1]
    step = skin[nearest] - eyes
    height = np.einsum("ij,ij->i", step, normals[nearest])
    beside = np.einsum("ij,ij->i", step, step) - height**2 > areas.mean()
    missing = np.where(beside, 0.0, np.pi * soft / (height**2 + soft))
    return np.asarray(missing[:, None] * normals[nearest])


def _pull(eyes: Floats, skin: Floats, normals: Floats, areas: Floats, cell: float) -> Floats:
    """Sum (E,3) over the skin of solid angle times direction."""
    out = np.zeros((len(eyes), 3), np.float32)
    if not len(skin):
        return out.astype(np.float64)
    middle = skin.mean(axis=0)
    skin32, normals32 = (skin - middle).astype(np.float32), normals.astype(np.float32)
    weight = areas.astype(np.float32)
    soft = np.float32(_softness(areas, cell))
    step = max(1, 4_000_000 // len(skin))
    for start in range(0, len(eyes), step):
        eye = (eyes[start : start + step] - middle).astype(np.float32)
        # |s-q|^2 and n.(s-q) by matrix products: the sum over the skin never forms an (E,S,3) array
        square = (eye**2).sum(1)[:, None] - 2 * eye @ skin32.T + (skin32**2).sum(1)[None]
        facing = (normals32 * skin32).sum(1)[None] - eye @ normals32.T
        share = weight * facing / (np.maximum(square, 0) + soft) ** 2
        out[start : start + step] = share @ skin32 - share.sum(1)[:, None] * eye
    return out.astype(np.float64)
