"""A crude difference between a scan and its CAD: what a real part has lost, by other code than the program's.

It imports nothing of damageest: samples of the two meshes, the nearest one, its plane, and a fit of its own. What is
compared is named: `deeper` is the sum over the skin that lies deeper than the tolerance; `down` goes on from there to
where the skin beside it is no deeper than a quarter of the tolerance. A damage volume reaches from the inner surface up
to the skin and ends where the rim does, so it lies between the two, within the errors of its pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from damageest.geometry.vectors import cross_corners

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SAMPLES = 200_000
"""Places on each mesh."""
FITTED = 20_000
"""Places that a pose is fitted with."""
ROUNDS = 40
"""Rounds of a fit."""
KEPT = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Shares of the places, those that lie nearest, that a fit counts: each gives a pose. What is worn most is left out."""
REACH = 5.0
"""Distance from the skin, in tolerances and at least, beyond which a place shows something else."""
JOINED = 3.0
"""Distance in mean gaps of the samples up to which they are of one loss."""
FADES = 0.25
"""Depth, in tolerances, down to which `down` follows the loss."""
AS_WELL = 1.15
"""Deviation of the places that are no loss, in times that of the best pose, up to which a pose fits nearly as well."""


@dataclass(frozen=True)
class Samples:
    """Places (N,3) on a mesh, spread by area, with outward unit ``normals`` (N,3), each for an ``area``."""

    places: Floats
    normals: Floats
    area: float


@dataclass(frozen=True)
class Loss:
    """The largest connected loss in a pose: volumes ``deeper`` than the tolerance and ``down`` to the skin beside it,
    their ``skin`` (area deeper than the tolerance), and ``off``: root mean square of what is no loss."""

    deeper: float
    down: float
    skin: float
    off: float


def sample(vertices: Floats, faces: Ints, count: int = SAMPLES, seed: int = 0) -> Samples:
    """Places on a mesh by area: a random point in a triangle that is drawn by its area."""
    rng = np.random.default_rng(seed)
    corners = vertices[faces]
    cross = cross_corners(corners)
    double = np.linalg.norm(cross, axis=1)
    drawn = np.searchsorted(np.cumsum(double) / double.sum(), rng.random(count))
    drawn = np.minimum(drawn, len(faces) - 1)
    a, b = rng.random((2, count))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    first = corners[drawn, 0]
    places = first + a[:, None] * (corners[drawn, 1] - first) + b[:, None] * (corners[drawn, 2] - first)
    return Samples(places, cross[drawn] / np.maximum(double[drawn], 1e-300)[:, None], float(double.sum()) / 2 / count)


def measure_depth(part: Samples, tree: cKDTree, places: Floats, reach: float) -> tuple[Floats, Ints]:
    """(N,) how deep places (N,3) lie below the plane of the nearest sample of the part, NaN beyond the reach; and that
    sample (N,)."""
    apart, nearest = tree.query(places, distance_upper_bound=reach)
    near = np.isfinite(apart)
    at = np.where(near, nearest, 0)
    depth = -np.einsum("ij,ij->i", places - part.places[at], part.normals[at])
    return np.where(near, depth, np.nan), at


def fit(part: Samples, tree: cKDTree, places: Floats, start: Floats, kept: float, reach: float) -> Floats:
    """The pose (4,4) of places (N,3) in the part's frame, from ``start`` on: point to plane, by the share ``kept`` of
    them that lies nearest."""
    T = start.copy()
    some = places[:: max(1, len(places) // FITTED)]
    for _ in range(ROUNDS):
        at = some @ T[:3, :3].T + T[:3, 3]
        depth, nearest = measure_depth(part, tree, at, reach)
        size = np.abs(depth)
        used = size <= np.nanquantile(size, kept)
        normals = part.normals[nearest[used]]
        middle = at.mean(axis=0)
        rows = np.column_stack([np.cross(at[used] - middle, normals), normals])
        step = np.linalg.lstsq(rows, depth[used], rcond=None)[0]
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        move = np.eye(4)
        move[:3, :3], move[:3, 3] = turn, middle - turn @ middle + step[3:]
        T = move @ T
        if np.abs(step).max() < 1e-7:
            break
    return T


def measure_loss(
    part: Samples, tree: cKDTree, scan: Samples, T: Floats, tolerance: float, within: Floats | None = None
) -> Loss:
    """The largest connected loss of the scan in a pose; ``within`` (M,3): places in the part's frame, near which it has
    to lie, as the skin that a site removes."""
    at = scan.places @ T[:3, :3].T + T[:3, 3]
    depth, _ = measure_depth(part, tree, at, REACH * max(tolerance, 0.2))
    gap = JOINED * float(np.sqrt(scan.area))
    off = float(np.sqrt(np.nanmean(np.where(depth < tolerance, depth, np.nan) ** 2)))
    deep = depth > tolerance
    if within is not None:
        deep &= cKDTree(within).query(at, distance_upper_bound=2 * gap)[0] < 2 * gap
    chosen = np.flatnonzero(deep)
    if not len(chosen):
        return Loss(0.0, 0.0, 0.0, off)
    label = _connect(at[chosen], gap)
    largest = int(np.bincount(label, depth[chosen]).argmax())
    core = chosen[label == largest]
    fading = np.flatnonzero(depth > FADES * tolerance)
    around = _connect(at[fading], gap)
    own = np.isin(fading, core)
    apron = fading[around == np.bincount(around[own]).argmax()]
    # what fades out counts as far as a site may reach: from the rim on as wide as two tolerances of slope 1 in 5
    close = cKDTree(at[core]).query(at[apron], distance_upper_bound=10 * tolerance)[0] < 10 * tolerance
    return Loss(
        float(depth[core].sum()) * scan.area,
        float(depth[apron[close]].sum()) * scan.area,
        len(core) * scan.area,
        off,
    )


def measure_range(
    part: Samples, scan: Samples, pose: Floats, tolerance: float, within: Floats | None = None
) -> list[tuple[str, Loss]]:
    """The loss in the pose (4,4) that was found, and in those of fits to smaller and larger shares of the skin. The
    first is that of ``pose``; of the others those that fit nearly as well."""
    tree = cKDTree(part.places)
    reach = REACH * max(tolerance, 0.2)
    found = [("the pose found", measure_loss(part, tree, scan, pose, tolerance, within))]
    for kept in KEPT:
        T = fit(part, tree, scan.places, pose, kept, reach)
        found.append((f"fitted to the nearest {kept:.0%}", measure_loss(part, tree, scan, T, tolerance, within)))
    best = min(loss.off for _, loss in found)
    return [found[0], *(one for one in found[1:] if one[1].off <= AS_WELL * best)]


def _connect(places: Floats, gap: float) -> Ints:
    """(N,) the number of the group of each place; places nearer than the gap are of one group."""
    pairs = cKDTree(places).query_pairs(gap, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(places),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)
