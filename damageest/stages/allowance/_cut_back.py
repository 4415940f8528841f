"""Cuts the cavity back into intact metal, so that deposition starts on a clean surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh, Part, Solid
from damageest.errors import StageError
from damageest.geometry.bodies import label_pieces
from damageest.geometry.distance import Closest, SurfaceTree, distance_to_mesh, is_inside, signed_distance
from damageest.geometry.duplicates import list_used
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import BALANCE, subtract_lost, to_arrays, to_manifold, to_solid
from damageest.stages.allowance._booleans import simplify_exactly

FINE, COARSE, MAX_CELL = 0.5, 0.75, 1.0
"""Edge of a grid cell, in tolerances: for a cut-back of less than two tolerances, for a larger one, and the largest
one where memory limits the number of cells."""
ROUGH = 2.0
"""Largest edge of a grid cell where the surface is fitted afterwards."""


def cut_back(
    damage: Solid, part: Part, others: Solid | None, inner: float, tolerance: float
) -> tuple[Solid, Solid | None]:
    """The damage volume and all metal within ``inner`` of its inner damage surface, and up to half a tolerance more;
    and what takes it out of the part (see `Deposit.opening`), None where that is not known.

    ``others``: damage volumes of other sites, which the cavity leaves out. Raises StageError where the grid would not
    fit in memory, or the volumes do not add up.
    """
    origin = part.bounds.mean(axis=0)
    lost, whole = to_manifold(damage, origin), to_manifold(part, origin)
    inside = find_inner_faces(damage, part)
    if not inside.any():
        return damage, None
    region = to_manifold(_grow_faces(damage, damage.faces[inside], part, inner, tolerance), origin)
    region = region.simplify(tolerance / 16)
    near = None if others is None else _take_near(others, np.reshape(region.bounding_box(), (2, 3)) + origin)
    if near is not None:
        region -= to_manifold(near, origin)
    intact = subtract_lost(whole, lost)
    taken, rest = intact.split(region)
    ways: tuple[Callable[[], Any], ...] = (lambda: lost + taken, lambda: lost + (whole ^ region), lambda: whole - rest)
    tried: list[tuple[float, Any]] = []
    for way in ways:
        cavity = way()
        missing = abs(whole.volume() - rest.volume() - cavity.volume())
        missing += abs(lost.volume() + taken.volume() - cavity.volume())
        tried.append((missing, cavity))
        if missing <= BALANCE * whole.volume():
            break
    missing, cavity = min(tried, key=lambda item: item[0])
    solid = to_solid(simplify_exactly(cavity, part.diagonal), origin)
    if solid is None or missing > 1e-3 * lost.volume():
        raise StageError(
            f"the volumes of the cut-back do not add up: {missing:.3g} is lost or counted twice",
            "use a slightly different inner, or boolean: pymeshlab",
        )
    return solid, to_solid(region + lost, origin)


def _take_near(others: Solid, bounds: Floats) -> Solid | None:
    """The bodies whose bounds meet ``bounds`` (2,3); None without any."""
    label = label_pieces(others.faces)
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    low = np.minimum.reduceat(others.triangles.min(axis=1)[order], starts)
    high = np.maximum.reduceat(others.triangles.max(axis=1)[order], starts)
    near = ((low < bounds[1]) & (high > bounds[0])).all(axis=1)
    chosen = np.isin(label, label[order][starts][near])
    return Solid(others.vertices, others.faces[chosen]) if chosen.any() else None


def _grow_faces(damage: Solid, faces: Any, part: Part, inner: float, tolerance: float) -> Solid:
    """The space near the part within ``inner`` plus a quarter of a tolerance of some ``faces`` of the damage volume."""
    from damageest.geometry.contour import MOST_NODES, extract_contour, fit_contour

    origin = part.bounds.mean(axis=0)
    reach = inner + tolerance / 4
    mesh = Mesh(damage.vertices - origin, faces)
    used = mesh.vertices[list_used(faces)]
    margin = reach + 2 * MAX_CELL * tolerance
    low = np.maximum(used.min(axis=0) - margin, part.bounds[0] - origin - 4 * tolerance)
    high = np.minimum(used.max(axis=0) + margin, part.bounds[1] - origin + 4 * tolerance)
    tree, nominal = SurfaceTree(mesh), Mesh(part.vertices - origin, part.faces)
    # within a tolerance: it only says where the surface matters
    lost = Mesh(*to_arrays(to_manifold(damage, origin).simplify(tolerance / 4)))

    def closest(points: Floats) -> tuple[Floats, Floats]:
        found = tree.closest(points) if len(points) else Closest(np.empty(0), np.empty(0, np.int64), points)
        return found.distance, found.place

    def distance(points: Floats) -> Floats:
        return closest(points)[0] - reach

    def is_in_metal(points: Floats, radius: float) -> Flags:
        found = signed_distance(points, nominal)[0] < radius
        found[found] = (distance_to_mesh(points[found], lost) < radius + tolerance) | ~is_inside(points[found], lost)
        return found

    least = float((np.prod(high - low + 2 * tolerance) / MOST_NODES) ** (1 / 3)) * 1.02
    cell = max((FINE if inner < 2 * tolerance else COARSE) * tolerance, least)
    if cell > MAX_CELL * tolerance:
        raise StageError(
            f"the damage is too large to cut back within the tolerance {tolerance:.3g}: the grid would not fit in "
            "memory",
            f"use a tolerance of {cell / MAX_CELL:.3g} or more, or inner: 0",
        )
    # the surface bends by a radius of `inner` at least, but for concave edges: a rough grid is enough where it has none
    rough = min(np.sqrt(inner * tolerance) / 2, ROUGH * tolerance)
    if rough > 1.3 * cell:
        cell = rough
    nx, ny, nz = (np.ceil((high - low) / cell).astype(int) + 1).tolist()
    found = extract_contour(distance, low, (nx, ny, nz), cell, is_in_metal)
    if cell == rough:
        found = fit_contour(found, closest, reach, tolerance / 8, is_in_metal)
    return Solid(found.vertices + origin, found.faces)
