"""The floor of a cavity, and the signed distance from it, which conformal layers follow.

The floor is what of a deposit lies on metal and is not too steep; what is steeper is a wall. Beyond its rim the floor
goes on as a plane, so that a layer ends at a wall, or at an open side, as it lies before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.distance import SurfaceTree, distance_to_mesh, signed_distance
from damageest.geometry.edges import list_edges
from damageest.geometry.solids import to_arrays
from damageest.geometry.vectors import normalise
from damageest_paths.process.process import Process

STEEPEST, ROUND = np.radians(75.0), np.radians(80.0)
"""Largest angles between the floor's normal and the build direction: where it is flat, and where it is round. What is
steeper is a wall."""
LEANING = np.radians(60.0)
"""The same where no layer follows that."""
MAIN = 0.1
"""Share of the area of the largest piece of floor, as seen along the build direction, from which another is followed
where layers do not follow all."""
TORN, MOST_TORN = 0.02, 0.1
"""Share of the layers that may be torn at steps of a floor before the next is tried, and at most."""
TURNS = 0.2
"""Least standard deviation of the angles of a round piece between both, in shares of the range; 0.29: evenly spread."""
PROBE = 0.15
"""Share of the bead's width or height by which metal is thick where a face lies on it: slivers do not count."""
EDGE = 0.5
"""Longest edge of the floor's triangles in bead widths."""
SPECK = 0.25
"""Area, in squares of the bead's width, up to which a piece of wall within the floor is floor, and the other way."""


class Depth(NamedTuple):
    """``distance`` (N,) above the floor, negative below it; ``upward`` (N,3): unit vectors along which it grows."""

    distance: Floats
    upward: Floats


@dataclass(frozen=True, eq=False)
class Floor:
    """``mesh``: open, its normals into the deposit, in local coordinates. ``normals`` (V,3) of its vertices; ``on_rim``
    (V,): whether they are on its border; ``rim_edges`` (F,3): whether the edge opposite of each corner is."""

    mesh: Mesh
    tree: SurfaceTree
    normals: Floats
    on_rim: Flags
    rim_edges: Flags

    def measure(self, points: Floats) -> Depth:
        """The depth of points (N,3). Where the nearest place is on the rim, it is that above the plane there."""
        if not len(points):
            return Depth(np.empty(0), np.empty((0, 3)))
        distance, face, place = self.tree.closest(points)
        share = find_shares(self.mesh.triangles[face], place)
        corners = self.mesh.faces[face]
        normal = normalise(np.einsum("nk,nki->ni", share, self.normals[corners]))
        away = points - place
        above = np.einsum("ni,ni->n", away, normal)
        beyond = ((share < 1e-6) & self.rim_edges[face]).any(axis=1)
        beyond |= ((share > 1 - 1e-6) & self.on_rim[corners]).any(axis=1)
        signed = np.where(above < 0, -distance, distance)
        # very near to the floor the difference of two places has no direction
        unsure = beyond | (distance < 1e-9 * self.tree.mesh.diagonal)
        upward = np.where(unsure[:, None], normal, away / np.where(signed == 0, 1, signed)[:, None])
        return Depth(np.where(beyond, above, signed), upward)


def find_shares(triangles: Floats, places: Floats) -> Floats:
    """Barycentric coordinates (N,3) of places (N,3) in triangles (N,3,3)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    first = np.einsum("ni,ni->n", np.cross(c - b, places - b), normal) / square
    second = np.einsum("ni,ni->n", np.cross(a - c, places - c), normal) / square
    share = np.clip(np.stack([first, second, 1 - first - second], axis=1), 0, 1)
    return np.asarray(share / share.sum(axis=1, keepdims=True))


def list_floors(body: Any, metal: Any, process: Process) -> Iterator[tuple[Floor, float]]:
    """Floors of a deposit, a Manifold in local coordinates, on the metal; none where nothing of it is floor.

    The first goes on where it is round; the second, if that makes a difference, does not. Then come those of large
    pieces alone, without and with what leans much: scans leave scraps of floor on walls and along the rim. With each,
    the share of its layers that may be torn.
    """
    if metal.is_empty():
        return
    width = process.bead.width
    vertices, faces = to_arrays(body.refine_to_length(EDGE * width))
    mesh = Mesh(vertices, faces)
    area = mesh.face_areas
    sound = area > 1e-12 * width**2
    on_metal, standing = np.zeros(len(faces), bool), Mesh(*to_arrays(metal))
    middle, deep = mesh.triangles.mean(axis=1), PROBE * min(width, process.height)
    near = np.flatnonzero(sound)
    near = near[distance_to_mesh(middle[near], standing) < deep]
    if len(near):
        on_metal[near] = signed_distance(middle[near] + deep * mesh.face_normals[near], standing)[0] < 0
    angle = np.arccos(np.clip(-mesh.cross[:, 2] / np.maximum(2 * area, 1e-300), -1, 1))
    flat = on_metal & (angle < STEEPEST)
    pairs = _find_neighbours(faces)

    def drop_specks(is_floor: Flags) -> Flags:
        return _drop_specks(pairs, on_metal, is_floor, area, SPECK * width**2)

    round_ = _find_round(pairs, on_metal & ~flat & (angle < ROUND), angle, area)
    level = drop_specks(flat)
    found = [(drop_specks(flat | round_), TORN), (level, TORN)] if round_.any() else [(level, TORN)]
    for kept in (level, drop_specks(flat & (angle < LEANING))):
        main = _keep_main(pairs, kept, area * np.cos(angle))
        found = [one for one in found if (one[0] != main).any()] + [(main, MOST_TORN)]
    for kept, torn in found:
        if kept.any():
            yield make_floor(vertices, faces[kept][:, ::-1], width), torn


def _find_round(pairs: tuple[Ints, Ints], steep: Flags, angle: Floats, area: Floats) -> Flags:
    """Which of the ``steep`` faces (F,) lie in pieces that are round: a wall that leans has one angle. ``pairs``: as of
    `_find_neighbours`."""
    piece = _label(pairs, steep)
    weight = area * steep
    total = np.maximum(np.bincount(piece, weights=weight), 1e-300)
    mean = np.bincount(piece, weights=weight * angle) / total
    spread = np.sqrt(np.bincount(piece, weights=weight * (angle - mean[piece]) ** 2) / total)
    return np.asarray(steep & (spread >= TURNS * (ROUND - STEEPEST))[piece])


def make_floor(vertices: Floats, faces: Ints, width: float) -> Floor:
    """The floor of faces (F,3) whose normals point into the deposit; ``width`` of a bead."""
    used, number = np.unique(faces, return_inverse=True)
    mesh = Mesh(vertices[used], number.reshape(-1, 3))
    edges = np.sort(np.stack([mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]], mesh.faces[:, [0, 1]]], axis=1), axis=2)
    _, which, count = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    rim_edges = (count[which.ravel()] == 1).reshape(-1, 3)
    on_rim = np.zeros(len(mesh.vertices), bool)
    on_rim[edges[rim_edges].ravel()] = True
    normals = _find_normals(mesh, on_rim, width / 2)
    return Floor(mesh, SurfaceTree(mesh), normals, on_rim, rim_edges)


def _find_normals(mesh: Mesh, on_rim: Flags, radius: float) -> Floats:
    """Normals (V,3) of the vertices: the mean of the faces there; on the rim, of those within a radius."""
    from scipy.spatial import cKDTree

    normals = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(normals, mesh.faces[:, corner], mesh.cross)
    rim = np.flatnonzero(on_rim)
    smooth = np.flatnonzero(mesh.face_normals[:, 2] > np.cos(ROUND))
    tree = cKDTree(mesh.triangles[smooth].mean(axis=1))
    for vertex, near in zip(rim, tree.query_ball_point(mesh.vertices[rim], radius, return_sorted=True), strict=True):
        total = mesh.cross[smooth[near]].sum(axis=0)
        normals[vertex] = total if total.any() else normals[vertex]
    return normalise(normals)


def _drop_specks(pairs: tuple[Ints, Ints], on_metal: Flags, is_floor: Flags, area: Floats, smallest: float) -> Flags:
    """Whether each face (F,) is floor, where small pieces of wall, and of floor, are like what is round them."""
    first, second = pairs
    found = is_floor.copy()
    for kind in (True, False):
        mine = on_metal & (found == kind)
        piece = _label(pairs, mine)
        small = mine & (np.bincount(piece, weights=area * mine)[piece] < smallest)
        if not kind:  # not where it is on the border
            border = np.zeros(len(found), bool)
            border[piece[np.concatenate([first[~on_metal[second]], second[~on_metal[first]]])]] = True
            small &= ~border[piece]
        found[small] = not kind
    return found & on_metal


def _keep_main(pairs: tuple[Ints, Ints], is_floor: Flags, seen: Floats) -> Flags:
    """Which of the faces (F,) that are floor lie in its large pieces, as seen along the build direction: ``seen`` (F,)
    areas."""
    piece = _label(pairs, is_floor)
    total = np.bincount(piece, weights=seen * is_floor)
    return np.asarray(is_floor & (total >= MAIN * total.max(initial=0.0))[piece])


def _find_neighbours(faces: Ints) -> tuple[Ints, Ints]:
    """The two faces (K,) of each edge that faces (F,3) share."""
    edges = list_edges(faces)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort([edges[:, 1], edges[:, 0]])
    same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
    return owner[order][:-1][same], owner[order][1:][same]


def _label(pairs: tuple[Ints, Ints], chosen: Flags) -> Ints:
    """The number of the piece of each of the faces (F,), where the ``chosen`` ones that are neighbours make one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first, second = pairs
    linked = chosen[first] & chosen[second]
    graph = coo_matrix((np.ones(linked.sum()), (first[linked], second[linked])), (len(chosen), len(chosen)))
    return np.asarray(connected_components(graph, directed=False)[1])
