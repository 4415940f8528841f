"""The bodies into which a damage surface divides the part, and which of them are lost."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh, Part
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.loops import trace_loops
from damageest.geometry.solids import compose_shells, to_arrays, to_manifold
from damageest.stages.enclose import NotSeparatedError

THIN = 2e-4
"""Half of the thickness of the cut, in tolerances."""
MOST_BOTH = 0.02
"""Area of a body on the second side of the damage surface, at most, as a share of that on both."""
MOST_INTACT = 0.02
"""Share of the intact points that may lie on the lost bodies."""
LEAST_DIFFERENCE = 0.1
"""By how much the shares of intact points on the two sides must differ."""
MOST_ASKED = 4000


def divide_part(part: Part, sheet: Mesh, own: int, intact: Floats, side: str, tolerance: float) -> tuple[Any, Any]:
    """The lost metal and what is left, as Manifolds relative to the middle of the part's bounds.

    Args:
        part: as designed.
        sheet: the damage surface, extended until it ends outside the part; its first ``own`` faces are the surface.
        intact: (K,3) points on the intact skin, in the part's frame.
        side: auto, smaller or larger.
        tolerance: in the part's unit.

    Raises NotSeparatedError where the surface does not divide the part; StageError where the side is not shown.
    """
    origin = part.bounds.mean(axis=0)
    body = to_manifold(part, origin)
    bodies = (body - to_manifold(thicken(sheet, THIN * tolerance), origin)).decompose()
    meshes = [Mesh(*to_arrays(one, origin)) for one in bodies]
    area = np.array([_measure_sides(mesh, sheet, own, tolerance) for mesh in meshes])
    touched = area.sum(axis=1) > 1e-6 * part.area
    if len(bodies) < 2 or (np.minimum(area[:, 0], area[:, 1]) > MOST_BOTH * area.sum(axis=1))[touched].any():
        raise NotSeparatedError("the damage surface does not divide the part in two", method="implicit")
    front = touched & (area[:, 0] >= area[:, 1])
    back = touched & ~front
    if not front.any() or not back.any():
        raise NotSeparatedError("the damage surface cuts nothing off the part", method="implicit")
    lost = _choose_side(part, meshes, bodies, front, back, intact, side, sheet, tolerance)
    return _unite(bodies, lost), _unite(bodies, ~lost)


def thicken(sheet: Mesh, half: float) -> Mesh:
    """A closed mesh that has the sheet in its middle and is ``2 half`` thick."""
    normals = _measure_vertex_normals(sheet)
    count = len(sheet.vertices)
    vertices = np.concatenate([sheet.vertices + half * normals, sheet.vertices - half * normals])
    faces = [sheet.faces, sheet.faces[:, ::-1] + count]
    for loop in trace_loops(sheet.faces):
        after = np.roll(loop, -1)
        faces.append(np.stack([after, loop, loop + count], axis=1))
        faces.append(np.stack([after, loop + count, after + count], axis=1))
    return Mesh(vertices, np.concatenate(faces))


def _measure_vertex_normals(sheet: Mesh) -> Floats:
    total = np.zeros_like(sheet.vertices)
    unit = sheet.cross / np.maximum(np.linalg.norm(sheet.cross, axis=1), 1e-300)[:, None]
    for corner in range(3):
        np.add.at(total, sheet.faces[:, corner], unit)
    return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]


def _measure_sides(mesh: Mesh, sheet: Mesh, own: int, tolerance: float) -> tuple[float, float]:
    """Areas of a body's faces on the front and on the back of the damage surface, on its own faces alone."""
    middle = mesh.triangles.mean(axis=1)
    distance, face, _ = closest_on_mesh(middle, sheet)
    at = np.flatnonzero((distance < 3 * THIN * tolerance) & (face < own))
    lean = np.einsum("ij,ij->i", mesh.cross[at], sheet.cross[face[at]])
    area = np.linalg.norm(mesh.cross[at], axis=1) / 2
    size = np.linalg.norm(mesh.cross[at], axis=1) * np.linalg.norm(sheet.cross[face[at]], axis=1)
    along = lean > 0.9 * size
    against = lean < -0.9 * size
    return float(area[against].sum()), float(area[along].sum())


def _choose_side(
    part: Part, meshes: list[Mesh], bodies: list[Any], front: Flags, back: Flags, intact: Floats, side: str,
    sheet: Mesh, tolerance: float,
) -> Flags:  # fmt: skip
    volume = np.array([one.volume() for one in bodies])
    if side != "auto":
        smaller = volume[front].sum() < volume[back].sum()
        return front if smaller == (side == "smaller") else back
    few = intact[:: max(1, len(intact) // MOST_ASKED)]
    if len(few):
        away, _, _ = closest_on_mesh(few, sheet)
        few = few[away > 3 * tolerance]
    nearest = np.full(len(few), np.inf)
    owner = np.full(len(few), -1)
    for number, mesh in enumerate(meshes):
        distance, _, _ = closest_on_mesh(few, mesh) if len(few) else (np.empty(0), None, None)
        better = distance < nearest
        nearest[better], owner[better] = distance[better], number
    shares = [float(np.isin(owner, np.flatnonzero(one)).mean()) if len(few) else 0.0 for one in (front, back)]
    best = int(np.argmin(shares))
    if shares[best] > MOST_INTACT:
        raise NotSeparatedError(
            f"both sides of the damage surface hold intact points (at least {shares[best]:.0%} of them)",
            method="implicit",
        )
    if abs(shares[0] - shares[1]) < LEAST_DIFFERENCE:
        raise StageError(
            f"the intact points do not show which side is lost: the two sides hold {shares[0]:.0%} and {shares[1]:.0%}",
            "enclose: {use: divide, side: smaller} or side: larger, where you know",
            method="implicit",
        )
    return (front, back)[best]


def _unite(bodies: list[Any], which: Flags) -> Any:
    """The bodies, and all cavities: one that lies in another body takes nothing away."""
    return compose_shells([one for one, is_in in zip(bodies, which, strict=True) if is_in or one.volume() < 0])
