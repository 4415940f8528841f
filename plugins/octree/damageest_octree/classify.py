"""Which nodes of the octree lie in the part, and which of these the scan shows to be lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import INTACT, Deviation, Flags, Floats, Ints, Part, Scan, Sites
from damageest.geometry.distance import signed_distance
from damageest_octree.tree import Tree, build_tree, dilate, encode

PROBES = 5000
LEAK = 0.03
"""Share of the probes under intact skin that the flood may reach without a leak, by stray points of a thin wall."""


@dataclass(frozen=True, eq=False)
class Cube:
    """The cube of the octree, in the part's frame: ``origin`` (3,), its lowest corner; ``cell``, the edge of a cell, in
    the job's unit; ``depth``, the number of levels."""

    origin: Floats
    cell: float
    depth: int

    def find_cells(self, points: Floats) -> Ints:
        """The cells (N,3) that points (N,3) lie in."""
        return np.floor((points - self.origin) / self.cell).astype(np.int64)

    def find_centres(self, cells: Ints) -> Floats:
        """The centres (N,3) of cells (N,3)."""
        return np.asarray((cells + 0.5) * self.cell + self.origin)


@dataclass(frozen=True, eq=False)
class NodeFlags:
    """What each node of ``tree`` is, as flags (N,).

    ``in_part``: inside the part as designed. ``skin``: touched by the part's skin. ``intact``: skin that is intact, or
    that the scanner did not see. ``shell``: holds scan points on a damage. ``closing``: ``shell`` and ``reach`` cells
    round it. ``void``: outside the damaged part, found by the flood. ``leak``: share of the probes under intact skin
    that the flood reached. ``unseen``: share of the skin that counts as intact only because the scanner did not see it.
    """

    tree: Tree
    in_part: Flags
    skin: Flags
    intact: Flags
    shell: Flags
    closing: Flags
    void: Flags
    reach: int
    leak: float
    unseen: float

    @property
    def lost(self) -> Flags:
        """(N,) lost metal: the difference of the two octrees."""
        return self.void & (self.in_part | self.skin)


def classify_nodes(
    cube: Cube, skin: Ints, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, reach: int
) -> NodeFlags:
    """Builds one octree of part and scan and floods it from outside.

    ``skin`` (K,3): the cells that the part's skin touches. ``reach``: by how many cells the shell of damaged points is
    thickened, to close holes between points. The flood replaces the parity count along grid lines of the original
    method: a line that grazes a shell two cells thick miscounts. But the flood needs a shell without holes. Over intact
    skin the part's own cells are that shell.
    """
    damaged = aligned.points[sites.label > 0]
    intact = (deviation.label == INTACT) & (sites.label == 0)
    intact_skin, unseen = _find_intact_skin(cube, skin, aligned.points[intact], damaged, 1 + reach / 4)
    damaged_cells = np.unique(cube.find_cells(damaged), axis=0)
    shell = dilate(damaged_cells, reach)
    seen = cube.find_cells(aligned.points[intact])
    tree = build_tree(np.concatenate([encode(skin), encode(shell), encode(np.unique(seen, axis=0))]), cube.depth)
    count = len(tree.start)

    def mark(cells: Ints) -> Flags:
        out = np.zeros(count, bool)
        out[tree.locate(cells)] = True
        return out

    is_skin, is_shell, is_intact = mark(skin), mark(shell), mark(skin[intact_skin])
    pairs = tree.pair_neighbours()
    in_part = _find_nodes_in_part(cube, tree, pairs, is_skin, part)
    # Noise puts points of the intact skin into the cells beside it. Those inside the part block the flood too: at the
    # rim they are the shallow end of the damage. Those outside the part are left out.
    shallow = mark(seen) & (in_part | is_skin) & ~is_intact
    blocked = is_intact | is_shell | shallow
    void = _flood_from_outside(tree, pairs, ~blocked)
    probes = np.flatnonzero(intact)
    probes = probes[:: max(1, len(probes) // PROBES)]
    places, normals = aligned.points[probes], part.face_normals[deviation.face[probes]]
    leak = _measure_leak(cube, tree, in_part & ~blocked, void, places, normals, damaged, reach)
    return NodeFlags(
        tree, in_part, is_skin, is_intact, mark(damaged_cells) | shallow, is_shell | shallow, void, reach, leak, unseen
    )  # fmt: skip


def label_components(tree: Tree, members: Flags) -> Ints:
    """(N,) the number of the face-connected component of each member node; -1 for the other nodes."""
    return _label_members(tree.pair_neighbours(), members)


def _label_members(pairs: Ints, members: Flags) -> Ints:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = pairs[members[pairs].all(axis=1)]
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(members), len(members)))
    _, label = connected_components(graph, directed=False)
    out = np.full(len(members), -1, np.int64)
    out[members] = np.unique(label[members], return_inverse=True)[1]
    return out


def _flood_from_outside(tree: Tree, pairs: Ints, free: Flags) -> Flags:
    """(N,) the free nodes that are connected to the border of the cube through free nodes."""
    label = _label_members(pairs, free)
    border = ((tree.low == 0) | (tree.low + tree.size[:, None] == 1 << tree.depth)).any(axis=1)
    return np.asarray(free & np.isin(label, np.unique(label[border & free])))


def _find_nodes_in_part(cube: Cube, tree: Tree, pairs: Ints, skin: Flags, part: Part) -> Flags:
    """(N,) the nodes inside the part that its skin does not touch."""
    # No component of these nodes crosses the skin, so one exact sign for each component is enough.
    label = _label_members(pairs, ~skin)
    order = np.flatnonzero(label >= 0)
    order = order[np.lexsort((order, -tree.size[order]))]
    _, first = np.unique(label[order], return_index=True)
    nodes = order[first]
    centres = cube.origin + (tree.low[nodes] + tree.size[nodes, None] / 2) * cube.cell
    distance, _ = signed_distance(centres, part)
    return np.asarray((label >= 0) & (distance < 0)[np.maximum(label, 0)])


def _find_intact_skin(cube: Cube, skin: Ints, intact: Floats, damaged: Floats, factor: float) -> tuple[Flags, float]:
    """(K,) which of the skin cells are intact, and the share that counts as intact only because it was not seen.

    A skin cell is bare where the nearest point is farther away than the radius that holds six points there, times
    ``factor``; by chance that happens at one place in 400. Bare cells that are connected to a damage are lost, other
    bare cells were not seen. Each lost region then grows over the rim, where neighbouring points had covered it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(intact) < 7:
        return np.zeros(len(skin), bool), 0.0
    centres = cube.find_centres(skin)
    tree = cKDTree(intact)
    distance, nearest = tree.query(centres, workers=2)
    radius = np.asarray(tree.query(intact, 7, workers=2)[0])[:, -1]
    reach = np.maximum(radius[nearest], cube.cell) * factor
    bare = np.flatnonzero(distance > reach)
    if not len(bare):
        return np.ones(len(skin), bool), 0.0
    pairs = cKDTree(skin[bare]).query_pairs(1.8, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(bare), len(bare)))
    _, label = connected_components(graph, directed=False)
    beside = cKDTree(damaged).query(centres[bare], workers=2)[0] < 2 * reach[bare] + cube.cell
    is_lost = np.isin(label, np.unique(label[beside]))
    lost = bare[is_lost]
    is_intact = np.ones(len(skin), bool)
    if len(lost):
        to_lost = cKDTree(centres[lost]).query(centres, workers=2)[0]
        is_intact = (to_lost > 1.5 * reach) | (distance < np.maximum(0.3 * reach, 0.6 * cube.cell))
        is_intact[lost] = False
    return is_intact, float((~is_lost).sum() / len(skin))


def _measure_leak(
    cube: Cube, tree: Tree, full: Flags, void: Flags, points: Floats, normals: Floats, damaged: Floats, reach: int
) -> float:
    """Share of probes, three cells under ``points`` (N,3) of intact skin with these ``normals`` (N,3) and far from any
    damage, that the flood reached."""
    from scipy.spatial import cKDTree

    far = cKDTree(damaged).query(points, workers=2)[0] > (2 * reach + 8) * cube.cell
    nodes = tree.locate(cube.find_cells(points[far] - 3 * cube.cell * normals[far]))
    inside = full[nodes]
    return float(void[nodes[inside]].mean()) if inside.any() else 0.0
