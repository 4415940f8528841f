"""Damage sites by density (DBSCAN, paper 3.3)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from damageest.artefacts import DAMAGE, Deviation, Floats, Ints, Scan, Sites
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours, gather_around
from damageest.geometry.threads import count_threads
from damageest.stages.cluster import Cluster
from damageest.stages.cluster._density import measure_neighbour_distances, run_dbscan

NEIGHBOURHOOD = 12
"""Number of nearest scan points, itself included, among which other damage points are counted."""
LEFT_OUT = 0.05
"""Share of the damaged points that are in no group, from which it is told."""
MIN_DAMAGE = 4
"""How many of these, itself included, must be damage. Where noise moves one point in 700 beyond the tolerance (a
tolerance of four standard deviations and a pose error of one), one such point in two million has three others beside
it."""
FEWEST_DENSE, FAR = 4, 2.0
"""Points within eps, itself included, that make a point dense in the sparsest scan. There the walls of a loss in a thin
plate show too few: points that are in no site belong to one that they reach by steps of so many eps."""
MOST_STRAY, MOST_SITES = 0.25, 5
"""Points in no site that do not reach one, as a share of those that do, and sites, up to which these belong to them.
Where more lie anywhere, or sites lie everywhere, they are stray."""
MAX_FOR_ALL = 200_000
"""Number of scan points above which the gaps between them are measured at few places only."""


class Dbscan(Cluster):
    """DBSCAN of the points labelled damage, without clusters that noise can produce."""

    use: Literal["dbscan"] = "dbscan"
    eps: PositiveFloat | Literal["tolerance", "auto"] | None = Field(
        None,
        description="radius within which points are neighbours, in the job's unit; 'tolerance': the tolerance; "
        "'auto': where the sorted k-distance curve bends most; default: the tolerance or, where it is larger, the "
        "distance that bridges the gaps of the scan",
    )
    neighbours: int = Field(
        10, ge=5, le=20, description="k: number of points within eps, itself included, that make a point dense"
    )
    min_points: int = Field(4, ge=3, description="a cluster of fewer points is noise")
    min_extent: float = Field(
        1.0, ge=0, description="a cluster whose bounding box has a shorter diagonal is noise, in tolerances"
    )
    support: float = Field(
        0.15,
        ge=0,
        le=1,
        description="a cluster is noise where less than this share of its points has other damage points around it",
    )

    def run(self, aligned: Scan, deviation: Deviation, tolerance: float) -> Sites:
        """Sites, the one with most points first; of equal ones, the one that comes first in the scan."""
        label = np.zeros(len(aligned.points), np.int32)
        damage = np.flatnonzero(deviation.label == DAMAGE)
        if not len(damage):
            return Sites(label, 0)
        points = aligned.points[damage]
        gap, typical = _measure_gaps(aligned.points, self.neighbours)
        bridging = max(tolerance, 1.25 * gap)
        eps, why = self._choose_eps(points, tolerance, bridging)
        # A sparse scan has fewer than k points on damage of four tolerances across; it must be found all the same.
        expected = self.neighbours * (1.5 * tolerance / typical) ** 2 if typical else np.inf
        dense = int(np.clip(expected / 2, FEWEST_DENSE, self.neighbours))

        cluster = run_dbscan(points, eps, dense)
        supported = _is_supported(aligned.points, damage, deviation.label == DAMAGE, bridging)
        cluster = self._drop_noise(points, cluster, supported, tolerance)
        if dense == FEWEST_DENSE:
            cluster = _reach_out(points, cluster, FAR * eps)
        found, first, inverse, count = np.unique(cluster, return_index=True, return_inverse=True, return_counts=True)
        order = [i for i in np.lexsort((first, -count)) if found[i] >= 0]
        number = np.zeros(len(found), np.int32)
        number[order] = np.arange(1, len(order) + 1)
        label[damage] = number[inverse.ravel()]
        noise = int((label[damage] == 0).sum())
        notes = []
        if noise > LEFT_OUT * len(damage):
            notes.append(
                f"{noise} of {len(damage)} damaged points are in no site (eps {eps:.3g}: {why}; {dense} neighbours); "
                "raise cluster.eps if damage is missed"
            )
        if eps < bridging / 2:
            notes.append(
                f"cluster.eps is below the gaps of the scan ({bridging:.3g}): sites may be split or missed; raise it"
            )
        return Sites(label, len(order), tuple(notes))

    def _choose_eps(self, points: Floats, tolerance: float, bridging: float) -> tuple[float, str]:
        if self.eps == "tolerance":
            return tolerance, "the tolerance"
        if self.eps == "auto":
            bend = find_sharpest_bend(measure_neighbour_distances(points, self.neighbours))
            # On a scan without damage the curve is that of far-apart noise points and gives no useful eps.
            eps = float(np.clip(bend, bridging / 2, 4 * bridging)) if np.isfinite(bend) else bridging
            return eps, f"sharpest bend of the k-distance curve at {bend:.4g}"
        if self.eps is None:
            return bridging, "the tolerance" if bridging == tolerance else "from the gaps of the scan"
        return self.eps, "as set"

    def _drop_noise(self, points: Floats, cluster: Ints, supported: NDArray[np.bool_], tolerance: float) -> Ints:
        """``cluster`` (M,) with -1 for the points of clusters with too few points, extent or support to be damage."""
        inside = cluster >= 0
        if not inside.any():
            return cluster
        which = cluster[inside]
        count = np.bincount(which)
        share = np.bincount(which, weights=supported[inside]) / np.maximum(count, 1)
        low, high = np.full((len(count), 3), np.inf), np.full((len(count), 3), -np.inf)
        np.minimum.at(low, which, points[inside])
        np.maximum.at(high, which, points[inside])
        extent = np.linalg.norm(np.where(count[:, None] > 0, high - low, 0), axis=1)
        valid = (count >= self.min_points) & (extent >= self.min_extent * tolerance) & (share >= self.support)
        result = cluster.copy()
        result[inside] = np.where(valid[which], which, -1)
        return result


def find_sharpest_bend(average: Floats) -> float:
    """The distance at which the sorted curve of ``average`` (M,) neighbour distances bends most (paper 3.3).

    The bend is the largest second difference of 200 quantiles, not of single points, because differences between
    neighbours in a sorted sample are random. It is taken of the logarithm, because the distances between far outliers
    are the largest differences, but not the largest ratios. Where densities differ several times and much is noise, the
    bend may be that of the densest damage only.
    """
    average = np.sort(average[np.isfinite(average)])
    if len(average) < 3:
        return np.inf
    steps = min(len(average), 201)
    curve = average[np.linspace(0, len(average) - 1, steps).round().astype(np.int64)]
    log = np.log(np.maximum(curve, np.finfo(float).tiny))
    return float(curve[1 + np.argmax(log[:-2] - 2 * log[1:-1] + log[2:])])


def _measure_gaps(points: Floats, neighbours: int) -> tuple[float, float]:
    """95th percentile and median of the distance to the k-th nearest scan point, of evenly picked points: 5,000, or 600
    of a dense scan."""
    if len(points) <= neighbours:
        return 0.0, 0.0
    dense = len(points) > MAX_FOR_ALL
    picked = points[_draw_evenly(len(points), 600 if dense else 5000)]
    if dense:
        points = points[gather_around(points, picked, neighbours + 1, np.random.default_rng(0))]
    distance = find_neighbours(picked, neighbours + 1, points)[0][:, -1]
    return float(np.percentile(distance, 95)), float(np.median(distance))


def _draw_evenly(count: int, wanted: int) -> Ints:
    """At most ``wanted`` of ``count`` indices, evenly spaced."""
    return np.linspace(0, count - 1, min(count, wanted)).round().astype(np.int64)


def _reach_out(points: Floats, cluster: Ints, reach: float) -> Ints:
    """``cluster`` (M,), and for points in none (-1) that of the nearest point (M,3) in one, over and over, up to
    ``reach``; the same where many points reach none."""
    out = cluster.copy()
    while (out >= 0).any() and (out < 0).any():
        left, found = np.flatnonzero(out < 0), np.flatnonzero(out >= 0)
        distance, nearest = (column[:, 0] for column in find_neighbours(points[left], 1, points[found], reach))
        reached = np.isfinite(distance)
        if not reached.any():
            break
        out[left[reached]] = out[found[nearest[reached]]]
    stray = int((out < 0).sum())
    is_stray = stray > MOST_STRAY * ((cluster < 0).sum() - stray) or len(np.unique(out[out >= 0])) > MOST_SITES
    return cluster if is_stray else out


def _is_supported(points: Floats, damage: Ints, is_damage: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """(M,) whether enough of the nearest scan points of each damage point are damage too."""
    from scipy.spatial import cKDTree

    here = find_nearby(points, points[damage], reach)
    _, near = cKDTree(points[here]).query(
        points[damage], k=NEIGHBOURHOOD, distance_upper_bound=reach, workers=count_threads()
    )
    padded = np.append(is_damage[here], False)  # the index of a missing neighbour is one past the last
    result: NDArray[np.bool_] = padded[near].sum(axis=1) >= MIN_DAMAGE
    return result
