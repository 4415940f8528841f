"""What of an octree's cube lies in the part, and what of that the scan says is gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import INTACT, Deviation, Floats, Ints, Part, Scan, Sites
from damageest.geometry.distance import signed_distance
from damageest_octree.tree import Tree, dilated, encode, plant

Flags = NDArray[np.bool_]
PROBES = 5000
LEAK = 0.03
"""Share of the probes under sound skin that may turn out empty: stray points of a thin wall, not a leak."""


@dataclass(frozen=True, eq=False)
class Cube:
    """The cube of the octree: lowest corner, edge of a cell in the job's unit, depth."""

    origin: Floats
    cell: float
    depth: int

    def cells(self, points: Floats) -> Ints:
        return np.floor((points - self.origin) / self.cell).astype(np.int64)

    def centres(self, cells: Ints) -> Floats:
        return np.asarray((cells + 0.5) * self.cell + self.origin)


@dataclass(frozen=True, eq=False)
class Sides:
    """Per node of ``tree``: ``in_part``, ``skin`` (touched by the part), ``sound`` (skin that is still there, or that
    nobody saw), ``shell`` (holds points on a loss), ``closing`` (``shell`` and ``reach`` cells round it), ``void``
    (outside the damaged part, as far as the closing lets one see). ``leak``: share of the probes under sound skin that
    came out empty. ``unseen``: share of the skin that counts as sound only because nobody saw it."""

    tree: Tree
    in_part: Flags
    skin: Flags
    sound: Flags
    shell: Flags
    closing: Flags
    void: Flags
    reach: int
    leak: float
    unseen: float

    @property
    def gone(self) -> Flags:
        """The difference of the two octrees."""
        return self.void & (self.in_part | self.skin)


def divided(cube: Cube, skin: Ints, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, reach: int) -> Sides:
    """Builds one octree of part and scan and floods it from outside; ``skin`` (K,3) are the cells the part touches.

    The flood stands in for parity along lattice lines: lines that graze a shell two cells thick miscount, the flood
    does not, but it needs a shell without holes. Sound skin is closed by the part's own cells.
    """
    damaged = aligned.points[sites.label > 0]
    intact = (deviation.label == INTACT) & (sites.label == 0)
    sound, unseen = _sound(cube, skin, aligned.points[intact], damaged, 1 + reach / 4)
    held = np.unique(cube.cells(damaged), axis=0)
    shell = dilated(held, reach)
    seen = cube.cells(aligned.points[intact])
    tree = plant(np.concatenate([encode(skin), encode(shell), encode(np.unique(seen, axis=0))]), cube.depth)
    count = len(tree.start)

    def flags(cells: Ints) -> Flags:
        out = np.zeros(count, bool)
        out[tree.locate(cells)] = True
        return out

    is_skin, is_shell, is_sound = flags(skin), flags(shell), flags(skin[sound])
    links = tree.links()
    in_part = _in_part(cube, tree, links, is_skin, part)
    # Points on sound skin that noise puts beside its cells thicken it outward; inward they would bound skins of no
    # thickness, and at the rim the shallow end of a loss, which the flood has to see.
    shallow = flags(seen) & (in_part | is_skin) & ~is_sound
    blocked = is_sound | is_shell | shallow
    void = _from_outside(tree, links, ~blocked)
    leak = _leak(cube, tree, in_part & ~blocked, void, part, aligned, deviation, intact, damaged, reach)
    return Sides(
        tree, in_part, is_skin, is_sound, flags(held) | shallow, is_shell | shallow, void, reach, leak, unseen
    )  # fmt: skip


def components(tree: Tree, members: Flags) -> Ints:
    """The number (N,) of the face-connected component of each member node, -1 for the others."""
    return _labelled(tree.links(), members)


def _labelled(links: Ints, members: Flags) -> Ints:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = links[members[links].all(axis=1)]
    graph = coo_array((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(len(members), len(members)))
    _, label = connected_components(graph, directed=False)
    out = np.full(len(members), -1, np.int64)
    out[members] = np.unique(label[members], return_inverse=True)[1]
    return out


def _from_outside(tree: Tree, links: Ints, free: Flags) -> Flags:
    label = _labelled(links, free)
    border = ((tree.low == 0) | (tree.low + tree.size[:, None] == 1 << tree.depth)).any(axis=1)
    return np.asarray(free & np.isin(label, np.unique(label[border & free])))


def _in_part(cube: Cube, tree: Tree, links: Ints, skin: Flags, part: Part) -> Flags:
    """No component of the nodes that the part does not touch crosses its surface, so one exact sign each will do."""
    label = _labelled(links, ~skin)
    order = np.flatnonzero(label >= 0)
    order = order[np.lexsort((order, -tree.size[order]))]
    _, first = np.unique(label[order], return_index=True)
    nodes = order[first]
    centres = cube.origin + (tree.low[nodes] + tree.size[nodes, None] / 2) * cube.cell
    distance, _ = signed_distance(centres, part)
    return np.asarray((label >= 0) & (distance < 0)[np.maximum(label, 0)])


def _sound(cube: Cube, skin: Ints, intact: Floats, damaged: Floats, patience: float) -> tuple[Flags, float]:
    """Which skin cells stand, and the share that does only because nobody saw them.

    Skin is bare where the nearest point is farther than the circle that holds six points there (one place in 400 by
    chance), times ``patience``. Bare skin that leads, cell by cell, to a loss is lost; other is unseen. A lost region
    then takes back the rim that its neighbours' reach had covered.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(intact) < 7:
        return np.zeros(len(skin), bool), 0.0
    centres = cube.centres(skin)
    tree = cKDTree(intact)
    away, nearest = tree.query(centres, workers=2)
    circle = np.asarray(tree.query(intact, 7, workers=2)[0])[:, -1]
    reach = np.maximum(circle[nearest], cube.cell) * patience
    bare = np.flatnonzero(away > reach)
    if not len(bare):
        return np.ones(len(skin), bool), 0.0
    pairs = cKDTree(skin[bare]).query_pairs(1.8, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(bare), len(bare)))
    _, label = connected_components(graph, directed=False)
    beside = cKDTree(damaged).query(centres[bare], workers=2)[0] < 2 * reach[bare] + cube.cell
    is_lost = np.isin(label, np.unique(label[beside]))
    lost = bare[is_lost]
    sound = np.ones(len(skin), bool)
    if len(lost):
        to_lost = cKDTree(centres[lost]).query(centres, workers=2)[0]
        sound = (to_lost > 1.5 * reach) | (away < np.maximum(0.3 * reach, 0.6 * cube.cell))
        sound[lost] = False
    return sound, float((~is_lost).sum() / len(skin))


def _leak(
    cube: Cube, tree: Tree, full: Flags, void: Flags, part: Part, aligned: Scan, deviation: Deviation, intact: Flags,
    damaged: Floats, reach: int,
) -> float:  # fmt: skip
    """Share of places a few cells under sound skin, far from any loss, that the flood reached."""
    from scipy.spatial import cKDTree

    chosen = np.flatnonzero(intact)
    chosen = chosen[:: max(1, len(chosen) // PROBES)]
    points = aligned.points[chosen]
    cross = part.cross[deviation.face[chosen]]
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    far = cKDTree(damaged).query(points, workers=2)[0] > (2 * reach + 8) * cube.cell
    nodes = tree.locate(cube.cells(points[far] - 3 * cube.cell * normals[far]))
    inside = full[nodes]
    return float(void[nodes[inside]].mean()) if inside.any() else 0.0
