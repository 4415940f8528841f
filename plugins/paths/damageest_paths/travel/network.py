"""Ways of the tool between passes in tight places, as inside a bore, over a network of poses near the passes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.process.process import Pass, measure_along

HEIGHTS = (0.5, 1, 2, 4, 8)
"""Heights of the poses above their pass, in hops."""
SPACING = 2.0
"""Distance of poses along a pass, in hops."""
MOST_NODES = 1500
"""Poses of a network at most; longer passes, or more, get fewer."""
NEIGHBOURS = 6
"""Poses of each sort that a pose is joined with: the nearest ones, where a turn counts as `ARM` times its chord."""
OTHER = np.radians(8.0)
"""Angle from which two tool axes count as different."""
ARM = 0.25
"""Share of the nozzle's reach that a turn by one radian counts as."""
SIFTED = (0.5, 0.25, 0.75)
"""Shares of a leg at which it is looked at before a way is searched."""
MOST_CHECKS = 100
"""Legs that are checked for one way at most."""
MOST_EXITS = 40
"""Poses from which a straight way out is tried, the nearest first."""
STEP = 0.5
"""Distance of the poses at which a way is checked, in gaps."""
KEPT = (1 + STEP) / 2
"""Share of the gap that the nozzle keeps at such poses: then it keeps half the gap between them."""
FIRST = 24
"""Poses at which a way is looked at before all others are."""
BLOCKED = 0.49
"""Share of the gap that a way has at most where a pose of it keeps less than that."""
MOST_POSES = 4000
"""Poses at which one leg of a way is checked at most."""


class Way(NamedTuple):
    """Points (K,3) with tool axes (K,3) between two poses, and the least distance of the nozzle."""

    points: Floats
    axes: Floats
    gap: float


class Network:
    """Poses above the passes, each joined with its neighbours. Legs are checked when a way would use them.

    What has been built only grows, so a leg that is not clear stays so; one that is clear is so until the next layer.
    """

    def __init__(self, groups: Sequence[Sequence[Pass]], hop: float, gap: float, reach: float) -> None:
        """``hop``: lift between passes, ``gap``: least distance of the nozzle, ``reach`` of it: its farthest point."""
        self._gap, self._arm = gap, ARM * reach
        self.points, self.axes, self._passes = _list_poses(groups, hop)
        self._places = np.concatenate([self.points, self._arm * self.axes], axis=1)
        self._shut: set[tuple[int, int]] = set()
        self._known: dict[tuple[int, int], float] = {}
        self._rank = -1
        self._is_free: Flags = np.ones(len(self.points), bool)

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._places)

    @cached_property
    def _pairs(self) -> Ints:
        """The numbers (M,2), ascending, of poses that are neighbours: of each the nearest ones, and the nearest above
        other passes and with other axes, since the poses of one pass lie close to each other."""
        far = cdist(self._places, self._places)
        np.fill_diagonal(far, np.inf)
        same = self._passes[:, None] == self._passes, self.axes @ self.axes.T > np.cos(OTHER)
        found = []
        for left_out in (np.zeros_like(same[0]), *same):
            count = min(NEIGHBOURS, len(far) - 1)
            own = np.where(left_out, np.inf, far)
            near = np.argpartition(own, count, axis=1)[:, :count] if count > 0 else np.empty((len(far), 0), np.int64)
            pairs = np.stack([np.repeat(np.arange(len(far)), near.shape[1]), near.ravel()], axis=1)
            found.append(pairs[np.isfinite(own[pairs[:, 0], pairs[:, 1]])])
        return np.unique(np.sort(np.concatenate(found), axis=1), axis=0).reshape(-1, 2)

    def find_way(self, start: tuple[Floats, Floats], stop: tuple[Floats, Floats], clearance: Clearance) -> Way | None:
        """The shortest way of the network from one pose, a point (3,) and an axis (3,), to another; None where no
        clear one is found."""
        graph = _Graph(self, [start, stop], clearance)
        found = graph.search(graph.start + 1)
        return None if found is None else graph.shorten(found)

    def find_exits(self, start: tuple[Floats, Floats], clearance: Clearance) -> Iterator[Way]:
        """Ways from one pose to poses of the network, the nearest first: each ends with the pose that it leads to."""
        graph = _Graph(self, [start], clearance)
        far = graph.measure_from_start()
        order = np.argsort(far, kind="stable")
        for node in order[np.isfinite(far[order])][:MOST_EXITS].tolist():
            found = graph.search(node)
            if found is not None:
                way = graph.shorten(found)
                last = graph.get_pose(node)
                yield Way(np.vstack([way.points, last[0]]), np.vstack([way.axes, last[1]]), way.gap)

    def prepare(self, clearance: Clearance) -> None:
        """Leaves out the poses that are surely not free of what stands now."""
        if clearance.until != self._rank:
            is_first, self._rank = self._rank < 0, clearance.until
            self._known.clear()
            free = np.flatnonzero(self._is_free)
            _, most = clearance.bound(self.points[free], self.axes[free], self._gap / 2)
            self._is_free[free] = most >= self._gap / 2
            if is_first:
                self._sift(clearance)

    def _sift(self, clearance: Clearance) -> None:
        """Leaves out the pairs between which the tool is surely not free at one of a few poses."""
        for share in SIFTED:
            one, other = self._pairs[self._is_free[self._pairs].all(axis=1)].T
            points = self.points[one] + share * (self.points[other] - self.points[one])
            axes = normalise(self.axes[one] + share * (self.axes[other] - self.axes[one]))
            _, most = clearance.bound(points, axes, self._gap / 2)
            self._pairs = np.stack([one, other], axis=1)[most >= self._gap / 2]


class _Graph:
    """A network with the ends of one way, whose numbers follow those of its poses."""

    def __init__(self, network: Network, ends: Sequence[tuple[Floats, Floats]], clearance: Clearance) -> None:
        network.prepare(clearance)
        self._net, self._clearance = network, clearance
        self.count = len(network.points)
        self.start = self.count
        self._points = np.vstack([network.points, *(end[0] for end in ends)])
        self._axes = np.vstack([network.axes, *(end[1] for end in ends)])
        places = np.concatenate([self._points, network._arm * self._axes], axis=1)
        pairs = [network._pairs]
        for k in range(len(ends)):
            _, near = network._tree.query(places[self.count + k], k=min(6 * NEIGHBOURS, self.count))
            near = np.atleast_1d(near)
            pairs.append(np.stack([near, np.full(len(near), self.count + k)], axis=1))
        joined = np.concatenate(pairs)
        free = np.append(network._is_free, np.ones(len(ends), bool))
        self._pairs = joined[free[joined].all(axis=1)]
        self._cost = np.linalg.norm(places[self._pairs[:, 0]] - places[self._pairs[:, 1]], axis=1) + 1e-9
        self._number = {pair: k for k, pair in enumerate(map(tuple, self._pairs.tolist()))}
        self._cost[[self._number[pair] for pair in network._shut & self._number.keys()]] = np.inf
        self._own: dict[tuple[int, int], float] = {}
        self._checks = 0

    def get_pose(self, node: int) -> tuple[Floats, Floats]:
        return self._points[node], self._axes[node]

    def measure_from_start(self) -> Floats:
        """The cost (N,) of the way to each pose of the network, as far as is known."""
        far, _ = self._run()
        return far[: self.count]

    def search(self, goal: int) -> list[int] | None:
        """The nodes of the shortest clear way from the start to a node with this number; None where none is found."""
        while self._checks < MOST_CHECKS:
            far, before = self._run()
            if not np.isfinite(far[goal]):
                return None
            nodes = [goal]
            while nodes[-1] != self.start:
                nodes.append(int(before[nodes[-1]]))
            nodes.reverse()
            legs = list(itertools.pairwise(nodes))
            # the ends are the tightest places
            legs.sort(key=lambda leg: min(self.count, max(leg)) < self.count)
            if all(self.measure(*leg) >= self._net._gap / 2 for leg in legs):
                return nodes
        return None

    def _run(self) -> tuple[Floats, Ints]:
        size = len(self._points)
        own = np.isfinite(self._cost)
        i, j = self._pairs[own].T
        graph: Any = csr_array((self._cost[own], (i, j)), shape=(size, size))
        far, before = dijkstra(graph, directed=False, indices=[self.start], return_predecessors=True)
        return far[0], before[0]

    def measure(self, one: int, other: int) -> float:
        """The least distance of the nozzle on the straight leg between two nodes."""
        pair = (min(one, other), max(one, other))
        kept = self._net._known if pair[1] < self.count else self._own
        if pair not in kept:
            self._checks += 1
            ends = [one, other]
            kept[pair] = measure_way(self._points[ends], self._axes[ends], self._clearance, self._net._gap)
        if kept[pair] < self._net._gap / 2:
            if pair in self._number:
                self._cost[self._number[pair]] = np.inf
            if pair[1] < self.count:
                self._net._shut.add(pair)
        return kept[pair]

    def shorten(self, nodes: list[int]) -> Way:
        """The way over the nodes, without those that a straight leg may leave out, and without its ends."""
        kept, k = [nodes[0]], 0
        while k < len(nodes) - 1:
            k = next(
                (m for m in range(len(nodes) - 1, k + 1, -1) if self.measure(nodes[k], nodes[m]) >= self._net._gap / 2),
                k + 1,
            )
            kept.append(nodes[k])
        gap = min(self.measure(*leg) for leg in itertools.pairwise(kept))
        return Way(self._points[kept[1:-1]], self._axes[kept[1:-1]], gap)


def measure_way(points: Floats, axes: Floats, clearance: Clearance, gap: float) -> float:
    """The least distance of the nozzle along a way (K,3) with tool ``axes`` (K,3), as a lower bound between the poses
    that are measured. Below half the ``gap`` only where some pose does not keep `KEPT` of it; then it is no bound."""
    dense, turned = _list_poses_along(points, axes, clearance, gap)
    some = np.linspace(0, len(dense) - 1, min(len(dense), FIRST)).astype(int)
    _, most = clearance.bound(dense[some], turned[some], gap / 2)
    if most.min() < gap / 2:
        return float(most.min())
    moves = clearance.bound_moves(dense, turned)
    found = clearance.measure_poses(dense, turned, KEPT * gap)
    least = float(min(found.min(), np.min((found[1:] + found[:-1] - moves) / 2, initial=np.inf)))
    return least if found.min() >= KEPT * gap else min(least, BLOCKED * gap)


def measure_blocked_way(points: Floats, axes: Floats, clearance: Clearance, gap: float) -> float:
    """The least distance of the nozzle at poses along a way that is not clear, each measured exactly."""
    least = np.inf
    for point, axis in zip(*_list_poses_along(points, axes, clearance, gap), strict=True):
        least = min(least, clearance.measure(point, axis))
        if least <= 0:
            break
    return least


def _list_poses_along(points: Floats, axes: Floats, clearance: Clearance, gap: float) -> tuple[Floats, Floats]:
    """Points (N,3) and axes (N,3) along a way, at most `STEP` of the ``gap`` apart: axes that are mixed evenly turn
    fastest half way."""
    half = np.minimum(clearance.bound_turns(axes) / (2 * clearance.reach), np.radians(85))
    far = np.linalg.norm(np.diff(points, axis=0), axis=1) + 2 * np.tan(half) * clearance.reach
    counts = np.clip(np.ceil(1.001 * far / (STEP * gap)).astype(int), 1, MOST_POSES)
    share = np.concatenate([*(np.arange(count) / count for count in counts), [0.0]])
    place = np.append(np.repeat(np.arange(len(counts)), counts), len(counts) - 1)
    share[-1] = 1.0
    dense = points[place] + share[:, None] * (points[place + 1] - points[place])
    turned = (1 - share)[:, None] * axes[place] + share[:, None] * axes[place + 1]
    return dense, normalise(turned)


def _list_poses(groups: Sequence[Sequence[Pass]], hop: float) -> tuple[Floats, Floats, Ints]:
    """Points (N,3) and axes (N,3) above places along the passes, ends included, and the numbers (N,) of the passes."""
    passes = [one for group in groups for one in group]
    length = sum(float(measure_along(one.points)[-1]) for one in passes)
    spacing = max(SPACING * hop, length * len(HEIGHTS) / MOST_NODES)
    most = max(MOST_NODES // (len(HEIGHTS) * max(len(passes), 1)), 1)
    points, axes, numbers = [], [], []
    for number, one in enumerate(passes):
        along = measure_along(one.points)
        count = min(int(np.ceil(along[-1] / spacing)) + 1, most)
        own = np.unique(np.searchsorted(along, np.linspace(0, along[-1], count)).clip(0, len(along) - 1))
        for height in HEIGHTS:
            points.append(one.points[own] + height * hop * one.axes[own])
            axes.append(one.axes[own])
            numbers.append(np.full(len(own), number))
    empty = np.empty((0, 3))
    none = np.empty(0, np.int64)
    return np.concatenate(points or [empty]), np.concatenate(axes or [empty]), np.concatenate(numbers or [none])
