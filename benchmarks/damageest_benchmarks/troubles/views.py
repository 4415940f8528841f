"""A virtual scanner that stands at given positions and sees what no other surface hides."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.vectors import normalise

DISTANCE = 2.5
"""Distance of a scanner position from the part's centre, in diagonals."""
GRAZING = 0.17
"""Cosine of the steepest angle between ray and normal under which a scanner still measures points: 80 degrees."""
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
_ABOVE = np.array([(1, 0, 0.7), (-0.5, 0.87, 0.7), (-0.5, -0.87, 0.7)])


def place_scanners(part: Mesh, count: int, rng: np.random.Generator) -> Floats:
    """Positions (V,3): one in a random direction, two or three round a random side, or eight that see all round."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.random(random_state=rng).as_matrix()
    directions = {1: _ABOVE[:1], 2: _ABOVE[:2], 3: _ABOVE, 8: _CORNERS}[count] @ turn.T
    directions = normalise(directions)
    return np.asarray(part.bounds.mean(axis=0) + DISTANCE * part.diagonal * directions)


def find_visible(caster: RayCaster, mesh: Mesh, points: Floats, normals: Floats, scanners: Floats) -> Flags:
    """Whether each point on the mesh is seen from each position: (N,V)."""
    lift = 1e-4 * mesh.diagonal
    visible = np.zeros((len(points), len(scanners)), dtype=np.bool_)
    for number, scanner in enumerate(scanners):
        way = points + lift * normals - scanner
        distance = np.linalg.norm(way, axis=1)
        direction = way / distance[:, None]
        facing = np.flatnonzero(np.einsum("ij,ij->i", direction, normals) < -GRAZING)
        first = caster.find_first(np.broadcast_to(scanner, (len(facing), 3)), direction[facing])[0]
        visible[facing, number] = first > distance[facing] * (1 - 3e-6)
    return visible


def scan_surface(
    mesh: Mesh, scanners: Floats | None, count: int, rng: np.random.Generator
) -> tuple[Floats, Ints | None]:
    """Points (count,3) without noise, even by area over all that is seen, and the view (count,) of each.

    Without scanners, all skin is seen, and there are no views. Raises StageError where nothing is seen.
    """
    if scanners is None:
        return sample_by_area(mesh, count, rng)[0][rng.permutation(count)], None
    caster = RayCaster(mesh)
    trial = _sample_visible(caster, mesh, scanners, 8000, rng)[0]
    if len(trial) < 40:
        raise StageError("the virtual scanner sees nothing of the part")
    wanted = int(1.1 * count * 8000 / len(trial))
    points, visible = _sample_visible(caster, mesh, scanners, wanted, rng)
    chosen = rng.permutation(len(points))[:count]
    # each point belongs to a random one of the views that see it
    weights = visible[chosen] * rng.random((len(chosen), len(scanners)))
    return points[chosen], weights.argmax(axis=1)


def _sample_visible(
    caster: RayCaster, mesh: Mesh, scanners: Floats, count: int, rng: np.random.Generator
) -> tuple[Floats, Flags]:
    points, face = sample_by_area(mesh, count, rng)
    normals = normalise(mesh.cross[face])
    visible = find_visible(caster, mesh, points, normals, scanners)
    seen = visible.any(axis=1)
    return points[seen], visible[seen]


def measure_seen_share(part: Mesh, left: Mesh, scanners: Floats | None, count: int = 30_000) -> float:
    """Share of the part's skin that is still there and that is seen from the positions, where ``left`` hides it."""
    points, face = sample_by_area(part, count, np.random.default_rng(31))
    intact = distance_to_mesh(points, left) < 1e-6 * part.diagonal if left is not part else np.ones(count, np.bool_)
    if scanners is None:
        return float(intact.mean())
    normals = normalise(part.cross[face])
    return float((find_visible(RayCaster(left), left, points, normals, scanners).any(axis=1) & intact).mean())
