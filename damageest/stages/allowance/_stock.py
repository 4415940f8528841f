"""Builds stock of given height on skin, as a solid.

It is a shell on each smooth patch, or a convex piece on each triangle where a shell would fold; and convex pieces on
convex edges and corners. Where the skin is smooth, the pieces on neighbouring triangles share their upper corners, so
there are no gaps. On a sharp convex edge a mitre connects the pieces; it is cut off where the edge is sharper than a
right angle. At a border with skin without stock the stock has straight walls along the normal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import find_members
from damageest.geometry.vectors import normalise
from damageest.stages.allowance._shells import build_shells
from damageest.stages.allowance._skin import SkinFaces

SMOOTH = 30.0
"""Largest angle in degrees between neighbouring triangles that may share upper corners."""
MAX_LEAN = 8.0
"""Largest angle in degrees between a common direction of the stock and the normal of a triangle."""
MAX_MITRE = 100.0
"""Largest angle in degrees between normals at an edge with a pointed mitre; a sharper edge gets `ROUNDS` mitres."""
ROUNDS = 3
INSET = 4e-3
"""How far inside its border the stock begins, in slacks. Stock that ended exactly where other metal begins would touch
it along lines without thickness."""
LIFT = 2e-3
"""How much higher than asked the stock is, in slacks: rounding errors leave it nowhere lower."""


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges between two faces of the skin.

    ``first``, ``second``: (E,) the faces. ``a``, ``b``: (E,) the ends, in the direction of the first face. ``at``:
    (E,2,2) the corners (as 3 x face + k) of the first and of the second face at a and b.
    """

    first: Ints
    second: Ints
    a: Ints
    b: Ints
    at: Ints


def build_stock(skin: SkinFaces, slack: float, has_room: bool = True, inset: float = INSET) -> Any:
    """A Manifold relative to the skin's origin: stock of the height of each face; over skin that bends
    between its triangles, up to half of ``slack`` more.

    It reaches a little below the skin; the caller cuts that off. ``has_room``: whether no stock meets that of opposite
    skin. ``inset``: how far inside the skin's border the stock begins, in slacks.
    """
    from manifold3d import Manifold, OpType

    skin = _inset_border(skin.select(skin.height > 0), inset * slack)
    if not len(skin.faces):
        return Manifold()
    edges = _find_edges(skin)
    height = skin.height + LIFT * slack
    group, up = _find_directions(skin, height, edges, slack / 2)
    sink = 1e-3 * slack
    corner = skin.triangles
    tops = corner + up[group].reshape(-1, 3, 3)
    lows = corner - sink * normalise(up)[group].reshape(-1, 3, 3)
    bodies: list[Any] = []
    rest = np.arange(len(corner))
    if has_room:
        shared = (group[edges.at[:, 0]] == group[edges.at[:, 1]]).all(axis=1)
        bodies, rest = build_shells(lows, tops, group, np.stack([edges.first, edges.second], 1), shared)
    clouds = list(np.concatenate([lows, tops], axis=1)[rest])
    over_edges, ends, heads = _build_over_edges(skin, height, edges, group, tops)
    clouds += over_edges
    for vertex in np.flatnonzero(np.bincount(ends, minlength=len(skin.vertices)) >= 2):
        mine = heads[ends == vertex].reshape(-1, 3)
        clouds.append(np.concatenate([skin.vertices[vertex : vertex + 1], mine[np.isfinite(mine[:, 0])]]))
    return Manifold.batch_boolean([*bodies, *(Manifold.hull_points(cloud) for cloud in clouds)], OpType.Add)


def _inset_border(skin: SkinFaces, by: float) -> SkinFaces:
    """The skin with its border moved inward by ``by``."""
    start, stop = skin.faces.ravel(), skin.faces[:, [1, 2, 0]].ravel()
    size = len(skin.vertices)
    lone = np.flatnonzero(~find_members(start * size + stop, stop * size + start))
    a, b = start[lone], stop[lone]
    inward = normalise(np.cross(skin.normal[lone // 3], skin.vertices[b] - skin.vertices[a]))
    total, count = np.zeros_like(skin.vertices), np.zeros(size)
    for end in (a, b):
        np.add.at(total, end, inward)
        np.add.at(count, end, 1)
    # at a corner equally far from both edges, but limited where the corner is sharp
    mean = total / np.maximum(count, 1)[:, None]
    step = by * mean / np.maximum(np.einsum("ij,ij->i", mean, mean), 0.25)[:, None]
    return replace(skin, vertices=skin.vertices + step)


def _find_edges(skin: SkinFaces) -> _Edges:
    """Edges of exactly two faces that use them in opposite directions."""
    start, stop = skin.faces.ravel(), skin.faces[:, [1, 2, 0]].ravel()
    size = len(skin.vertices)
    key = np.minimum(start, stop) * size + np.maximum(start, stop)
    order = np.argsort(key, kind="stable")
    _, where, count = np.unique(key[order], return_index=True, return_counts=True)
    i, j = order[where[count == 2]], order[where[count == 2] + 1]
    opposite = start[i] == stop[j]
    i, j = i[opposite], j[opposite]
    at = np.stack([np.stack([i, _next_corner(i)], 1), np.stack([_next_corner(j), j], 1)], 1)
    return _Edges(i // 3, j // 3, start[i], stop[i], at)


def _next_corner(corner: Ints) -> Ints:
    return corner // 3 * 3 + (corner % 3 + 1) % 3


def _find_directions(skin: SkinFaces, height: Floats, edges: _Edges, slack: float) -> tuple[Ints, Floats]:
    """The group (3F,) of each corner of each face, and the vector (G,3) from the skin to the top of the stock that all
    corners of a group share.

    The vector is along the mean normal of the faces. Each face then has its height, none more than ``slack`` above it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = 3 * len(skin.faces)
    dot = np.einsum("ij,ij->i", skin.normal[edges.first], skin.normal[edges.second])
    smooth = (dot > np.cos(np.radians(SMOOTH))) & (height[edges.first] == height[edges.second])
    pairs = edges.at[smooth].transpose(0, 2, 1).reshape(-1, 2)
    owner = np.arange(count) // 3
    angle = _measure_angles(skin.triangles).ravel()

    def group_corners(pairs: Ints) -> tuple[Ints, Floats, Floats]:
        links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
        size, group = connected_components(links, directed=False)
        mean = np.zeros((size, 3))
        np.add.at(mean, group, (angle + 1e-9)[:, None] * skin.normal[owner])
        mean = normalise(mean)
        least = np.ones(size)
        np.minimum.at(least, group, np.einsum("ij,ij->i", mean[group], skin.normal[owner]))
        return group.astype(np.int64), mean, least

    group, _, least = group_corners(pairs)
    # groups that bend too much for one common direction are split
    flat_enough = least[group] >= np.maximum(height / (height + slack), np.cos(np.radians(MAX_LEAN)))[owner]
    group, mean, least = group_corners(pairs[flat_enough[pairs].all(axis=1)])
    tall = np.zeros(len(mean))
    tall[group] = height[owner]
    return group, mean * (tall / least)[:, None]


def _measure_angles(triangles: Floats) -> Floats:
    """(F,3) angles at the corners, in radians."""
    along, back = (
        normalise(triangles[:, [1, 2, 0]] - triangles),
        normalise(triangles[:, [2, 0, 1]] - triangles),
    )
    return np.asarray(np.arccos(np.clip(np.einsum("fkj,fkj->fk", along, back), -1, 1)))


def _build_over_edges(
    skin: SkinFaces, height: Floats, edges: _Edges, group: Ints, tops: Floats
) -> tuple[list[Floats], Ints, Floats]:
    """The pieces on sharp convex edges.

    Returns:
        For each piece the points whose hull it is; the vertex (2E,) at each end of each edge; the upper points (2E,K,3)
        there, NaN where there are fewer.
    """
    n, m = skin.normal[edges.first], skin.normal[edges.second]
    outward = np.cross(skin.vertices[edges.b] - skin.vertices[edges.a], n)
    turn = np.arctan2(np.einsum("ij,ij->i", m, normalise(outward)), np.einsum("ij,ij->i", m, n))
    split = (group[edges.at[:, 0]] != group[edges.at[:, 1]]).any(axis=1)
    some = np.flatnonzero(split & (turn > 1e-6))
    mitres = _build_mitres(
        n[some], normalise(outward)[some], turn[some], height[edges.first[some]], height[edges.second[some]]
    )
    flat = tops.reshape(-1, 3)
    heads = []
    for end, vertex in enumerate((edges.a[some], edges.b[some])):
        own = flat[edges.at[some][:, :, end]]  # (E,2,3): of the first face and of the second
        heads.append(np.concatenate([own, skin.vertices[vertex][:, None] + mitres], axis=1))
    clouds = []
    for k, edge in enumerate(some):
        upper = np.concatenate([heads[0][k], heads[1][k]])
        base = skin.vertices[[edges.a[edge], edges.b[edge]]]
        clouds.append(np.concatenate([base, upper[np.isfinite(upper[:, 0])]]))
    return clouds, np.concatenate([edges.a[some], edges.b[some]]), np.concatenate(heads)


def _build_mitres(n: Floats, outward: Floats, turn: Floats, tall: Floats, other: Floats) -> Floats:
    """(E,ROUNDS,3) vectors from each edge to the points of its mitres, NaN where there are fewer.

    ``n`` (E,3): normal of the first face; ``outward`` (E,3): in its plane, across the edge; ``turn`` (E,): angle to
    the normal of the second face; ``tall``, ``other`` (E,): heights on the first and second face.
    """
    found = np.full((len(n), ROUNDS, 3), np.nan)
    blunt = turn <= np.radians(MAX_MITRE)
    # in the plane across the edge: the point `tall` above the first face and `other` above the second
    aside = (other - tall * np.cos(turn)) / np.sin(turn)
    short = np.hypot(tall, aside) <= 1.6 * np.maximum(tall, other)  # different heights at a blunt edge meet far away
    one = blunt & short
    found[one, 0] = tall[one, None] * n[one] + aside[one, None] * outward[one]
    step = turn / ROUNDS
    for k in range(ROUNDS):
        at, share = (k + 0.5) * step, (k + 0.5) / ROUNDS
        reach = ((1 - share) * tall + share * other) / np.cos(step / 2)
        point = reach[:, None] * (np.cos(at)[:, None] * n + np.sin(at)[:, None] * outward)
        found[~blunt, k] = point[~blunt]
    return found
