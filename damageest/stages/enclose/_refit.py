"""The surface of a Poisson solution moved onto the points that it was solved from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Solid
from damageest.geometry.neighbourhoods import make_tree, query_neighbours
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.vectors import normalise

NEIGHBOURS = 12
"""Points that each vertex is fitted to."""
NEAR, SOME = 4.0, 20_000
"""How far from the points vertices are fitted, in usual distances of neighbouring points, beside twice their largest
move; and of how many points, at most, this distance is measured."""
SAME_VOLUME = 0.003
"""Share by which the volume may change where triangles are joined."""


@dataclass(frozen=True, eq=False)
class PlacesOnSurface:
    """For V places near a surface through points: its unit ``normals`` (V,3) there; how far each place is to ``move``
    (V,) along them; how ``lopsided`` (V,) its neighbours are: the distance of their mean beside it, in distances of the
    farthest. ``is_known`` (V,): whether any neighbour faces as the place does."""

    normals: Floats
    move: Floats
    lopsided: Floats
    is_known: Flags


def refit_region(region: Solid, points: Floats, normals: Floats, most: float) -> Solid:
    """The region with its vertices moved along the points' normals onto the surface through the points (N,3).

    The grid resolves the zero level to a fraction of a cell only, and the screened solution smooths it. With points all
    round a vertex, the points give a better position. The chord between two points of a circular arc is normal to the
    mean of their normals, so curvature adds no error of second order. ``normals`` (N,3) point into the region. No
    vertex moves by more than ``most``; vertices without points near them do not move.
    """
    vertices, tree = region.vertices, make_tree(points)
    usual = float(np.median(query_neighbours(tree, points[:: len(points) // SOME + 1], 2)[0][:, -1]))
    # Half of the surface may close the region far from all points, where a search without reach takes longest.
    near = np.flatnonzero(np.isfinite(query_neighbours(tree, vertices, 1, 2 * most + NEAR * usual)[0][:, 0]))
    distance, index = query_neighbours(tree, vertices[near], min(NEIGHBOURS, len(points)))
    fit = fit_places(vertices[near], region.vertex_normals[near], points, -normals, distance, index)
    # Beyond the border of the points the fit would extrapolate: a vertex with points on one side only moves less.
    fade = np.clip(2 - 4 * fit.lopsided, 0, 1) * np.clip(2 - np.abs(fit.move) / most, 0, 1) * fit.is_known
    moved = vertices.copy()
    moved[near] += (np.clip(fit.move, -most, most) * fade)[:, None] * fit.normals
    try:
        return Solid(moved, region.faces)
    except ValueError:
        return region


def fit_places(
    at: Floats, own: Floats, points: Floats, normals: Floats, distance: Floats, index: Ints
) -> PlacesOnSurface:
    """Where places (V,3) come to lie on the surface through the points (N,3) with unit normals (N,3).

    ``own`` (V,3): the normal at each place; points that face another way do not count. ``distance`` and ``index``
    (V,K): the neighbours of each place among the points, as `find_neighbours` gives them.
    """
    facing = np.einsum("ij,ikj->ik", own, normals[index])
    reach = distance[:, -1:]
    weights = np.exp(-3 * (distance / reach) ** 2) * np.maximum(facing, 0) ** 2
    total = weights.sum(axis=1)
    share = weights / np.maximum(total, 1e-12)[:, None]
    way = np.einsum("ik,ikj->ij", share, normals[index])
    way = normalise(way, 1e-12)
    chord = points[index] - at[:, None]
    height = 0.5 * np.einsum("ikj,ikj->ik", chord, normals[index] + way[:, None])
    aside = np.einsum("ik,ikj->ij", share, chord)
    aside -= np.einsum("ij,ij->i", aside, way)[:, None] * way
    lopsided = np.linalg.norm(aside, axis=1) / reach[:, 0]
    return PlacesOnSurface(way, np.einsum("ik,ik->i", share, height), lopsided, total > 1e-3)


def thin_region(region: Solid, most: float) -> Solid:
    """The region with fewer triangles: its surface moves by less than ``most``, but flakes thinner than that may go. A
    grid gives triangles of one size, also where the surface is flat.

    The same where ``most`` is 0, where no closed surface comes out, or where the volume changes.
    """
    if not most:
        return region
    origin = region.bounds.mean(axis=0)
    try:
        less = to_solid(to_manifold(region, origin).simplify(most), origin)
    except ValueError:
        return region
    return less if less is not None and abs(less.volume / region.volume - 1) < SAME_VOLUME else region
