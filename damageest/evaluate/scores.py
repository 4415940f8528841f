"""How right a result is: solids compared by Booleans in float64, poses by what they do to the part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.skin import extract_ids
from damageest.geometry.solids import to_manifold, to_solid

MATCH = 0.1
"""Share of a loss that has to lie in found sites for it to count as found, and of a site in the losses for it not to
count as invented. How well it was found is for the distances to say."""
SAMPLES = 10_000
"""Points on each inner damage surface whose distance to the other is measured."""


@dataclass(frozen=True)
class Score:
    """``iou`` of found and true damage; ``volume_error`` found over true, less 1; ``surface_error``: volume of the
    symmetric difference per area of the true inner damage surface, in units of the tolerance; ``pose_error``: rms
    distance of the part's surface, moved by the pose's error, to the part. ``distance_median``, ``_95`` and ``_max``:
    of points on the found inner damage surface to the true one, and the other way round, together, where they are
    deeper than the tolerance. NaN where there is nothing to compare. ``found`` and ``missed`` of the true losses,
    ``invented`` sites."""

    iou: float
    volume_error: float
    surface_error: float
    pose_error: float
    distance_median: float = float("nan")
    distance_95: float = float("nan")
    distance_max: float = float("nan")
    found: int = 0
    missed: int = 0
    invented: int = 0


def union(solids: Sequence[Solid], origin: Floats) -> Any:
    """The ``manifold3d.Manifold`` of all solids together, relative to ``origin`` (3,)."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean([to_manifold(solid, origin) for solid in solids], OpType.Add)


def iou(found: Sequence[Solid], true: Sequence[Solid]) -> float:
    """Intersection over union of two sets of solids, each taken as its union; 1 where both are empty."""
    if not found or not true:
        return float(not found and not true)
    origin = true[0].bounds.mean(0)
    a, b = union(found, origin), union(true, origin)
    common = (a ^ b).volume()
    return float(common / (a.volume() + b.volume() - common))


def off_part(points: Floats, part: Mesh) -> Floats:
    """(N,) unsigned distance of points (N,3) to the part's surface."""
    return distance_to_mesh(points, part)


def surface_points(part: Mesh, count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """(count,3) points, uniform by area, and the (count,3) outward normals there."""
    rng = np.random.default_rng([811, seed])
    length = np.linalg.norm(part.cross, axis=1)
    face = rng.choice(len(length), count, p=length / length.sum())
    share = rng.dirichlet(np.ones(3), count)
    return np.einsum("ij,ijk->ik", share, part.triangles[face]), part.cross[face] / length[face, None]


def pose_error(part: Mesh, found: Floats, true: Floats) -> tuple[float, float]:
    """rms distance (after, way): of the part's surface, moved by the error of pose ``found`` (4,4), to the part, and to
    where it was. On a symmetric part a right pose may have a long way, but ends on the part."""
    points = surface_points(part, 4000)[0]
    D = found @ np.linalg.inv(true)
    moved = points @ D[:3, :3].T + D[:3, 3]
    way = np.linalg.norm(moved - points, axis=1)
    return float(np.sqrt((off_part(moved, part) ** 2).mean())), float(np.sqrt((way**2).mean()))


def depth(damage: Mesh, part: Mesh) -> float:
    """How far the damage reaches below the part's surface."""
    points = np.concatenate([damage.vertices, surface_points(damage, 2000)[0]])
    return float(off_part(points, part).max())


def distances(found: Mesh, true: Mesh, part: Mesh, tolerance: float) -> Floats:
    """(M,) distances of points, uniform by area, on each of two surfaces to the other.

    Of ``SAMPLES`` points on each, those that lie deeper than the tolerance below the part's skin: what lies shallower,
    as the damage does along its rim, is sound by definition, and where it ends is anyone's guess.
    """
    apart = []
    for seed, (mesh, other) in enumerate(((found, true), (true, found)), 1):
        points = surface_points(mesh, SAMPLES, seed)[0]
        apart.append(off_part(points[off_part(points, part) > tolerance], other))
    return np.concatenate(apart)


def matched(found: Sequence[Any], true: Any, part: Mesh, tolerance: float, origin: Floats) -> tuple[int, int, int]:
    """How many connected losses of the ``true`` damage were found and missed, and how many sites were invented.

    Args are Manifolds relative to ``origin`` (3,). A loss no deeper than the tolerance is none by definition.
    """
    from manifold3d import Manifold, OpType

    everything = Manifold.batch_boolean([Manifold(), *found], OpType.Add)
    hits = []
    for piece in true.decompose():
        solid = to_solid(piece, origin)
        if solid is not None and depth(solid, part) > tolerance:
            hits.append((piece ^ everything).volume() >= MATCH * piece.volume())
    invented = sum((site ^ true).volume() < MATCH * site.volume() for site in found)
    return sum(hits), len(hits) - sum(hits), invented


def score(
    part: Part,
    found: Sequence[Solid],
    true: Solid | None,
    tolerance: float,
    found_pose: Floats | None = None,
    true_pose: Floats | None = None,
) -> Score:
    """Scores the ``found`` damage, taken together, against the ``true`` one; poses are ``T_part_scan`` (4,4).

    Where the pose's error brings the part onto itself but elsewhere, as a symmetric part allows, the truth is moved
    along; the poses' small errors count against the damage otherwise.
    """
    nan = float("nan")
    after, way, D = nan, nan, np.eye(4)
    if found_pose is not None and true_pose is not None:
        after, way = pose_error(part, found_pose, true_pose)
        if after < tolerance and way > max(4 * after, tolerance / 4):
            D = found_pose @ np.linalg.inv(true_pose)
    origin = part.bounds.mean(0)
    if true is None:
        return Score(float(not found), nan, nan, after, invented=len(found))
    moved = Solid(true.vertices @ D[:3, :3].T + D[:3, 3], true.faces)
    expected, sites = to_manifold(moved, origin), [to_manifold(solid, origin) for solid in found]
    counts = matched(sites, expected, part, tolerance, origin)
    if not found:
        return Score(0.0, -1.0, nan, after, nan, nan, nan, *counts)
    actual = union(found, origin)
    common = (expected ^ actual).volume()
    a, b = expected.volume(), actual.volume()
    differs = max(a + b - 2 * common, 0.0)
    # which faces are the part's skin is told in the frame where they lie on it
    inner = extract_ids(true, part)
    left = extract_ids(whole, part) if (whole := to_solid(actual, origin)) else None
    far = (nan, nan, nan)
    if left is not None and len(left.faces) and len(inner.faces):
        other = Mesh(inner.vertices @ D[:3, :3].T + D[:3, 3], inner.faces)
        apart = distances(left, other, part, tolerance)
        far = (float(np.median(apart)), float(np.quantile(apart, 0.95)), float(apart.max())) if len(apart) else far
    surface = differs / inner.area / tolerance if inner.area else nan
    return Score(common / (a + b - common), b / a - 1, surface, after, *far, *counts)
