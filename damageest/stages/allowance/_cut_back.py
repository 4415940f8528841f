"""Cuts the cavity back into intact metal, so that deposition starts on a clean surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import BALANCE, subtract_lost, to_manifold, to_solid
from damageest.stages.allowance._booleans import simplify_exactly

FINE, COARSE, MAX_CELL = 0.5, 0.75, 1.0
"""Edge of a grid cell, in tolerances: for a cut-back of less than two tolerances, for a larger one, and the largest
one where memory limits the number of cells."""


def cut_back(damage: Solid, part: Part, others: Solid | None, inner: float, tolerance: float) -> Solid:
    """The damage volume and all metal within ``inner`` of its inner damage surface, and up to half a tolerance more.

    ``others``: damage volumes of other sites, which the cavity leaves out. Raises StageError where the grid would not
    fit in memory, or the volumes do not add up.
    """
    origin = part.bounds.mean(axis=0)
    lost, whole = to_manifold(damage, origin), to_manifold(part, origin)
    inside = find_inner_faces(damage, part)
    if not inside.any():
        return damage
    region = to_manifold(_grow_faces(damage, damage.faces[inside], part, inner, tolerance), origin)
    region = region.simplify(tolerance / 16)
    if others is not None:
        region -= to_manifold(others, origin)
    intact = subtract_lost(whole, lost)
    rest = intact - region
    ways: tuple[Callable[[], Any], ...] = (
        lambda: lost + (intact ^ region),
        lambda: lost + (whole ^ region),
        lambda: whole - rest,
    )
    tried: list[tuple[float, Any]] = []
    for way in ways:
        cavity = way()
        missing = abs(whole.volume() - rest.volume() - cavity.volume()) + (lost - cavity).volume()
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
    return solid


def _grow_faces(damage: Solid, faces: Any, part: Part, inner: float, tolerance: float) -> Solid:
    """The space near the part within ``inner`` plus a quarter of a tolerance of some ``faces`` of the damage volume."""
    from damageest.geometry.contour import MOST_NODES, extract_contour

    origin = part.bounds.mean(axis=0)
    reach = inner + tolerance / 4
    mesh = Mesh(damage.vertices - origin, faces)
    used = mesh.vertices[np.unique(faces)]
    margin = reach + 2 * MAX_CELL * tolerance
    low = np.maximum(used.min(axis=0) - margin, part.bounds[0] - origin - 4 * tolerance)
    high = np.minimum(used.max(axis=0) + margin, part.bounds[1] - origin + 4 * tolerance)
    least = float((np.prod(high - low + 2 * tolerance) / MOST_NODES) ** (1 / 3)) * 1.02
    cell = max((FINE if inner < 2 * tolerance else COARSE) * tolerance, least)
    if cell > MAX_CELL * tolerance:
        raise StageError(
            f"the damage is too large to cut back within the tolerance {tolerance:.3g}: the grid would not fit in "
            "memory",
            f"use a tolerance of {cell / MAX_CELL:.3g} or more, or inner: 0",
        )

    def distance(points: Floats) -> Floats:
        return distance_to_mesh(points, mesh) - reach

    nx, ny, nz = (np.ceil((high - low) / cell).astype(int) + 1).tolist()
    found = extract_contour(distance, low, (nx, ny, nz), cell)
    return Solid(found.vertices + origin, found.faces)
