"""How right a result is: solids compared by Booleans in float64, poses by what they do to the part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest.solids import to_manifold


@dataclass(frozen=True)
class Score:
    """``iou`` of found and true damage; ``volume_error`` found over true, less 1; ``surface_error``: volume of the
    symmetric difference per area of the true inner damage surface, in units of the tolerance; ``pose_error``: rms
    distance of the part's surface, moved by the pose's error, to the part. NaN where there is nothing to compare."""

    iou: float
    volume_error: float
    surface_error: float
    pose_error: float


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


def inner_area(damage: Solid, part: Mesh) -> float:
    """Area of the damage's surface that is not the part's: that of the true inner damage surface."""
    inner = off_part(damage.triangles.mean(1), part) > 1e-6 * part.diagonal
    return float(np.linalg.norm(damage.cross[inner], axis=1).sum() / 2)


def off_part(points: Floats, part: Mesh) -> Floats:
    """(N,) unsigned distance of points (N,3) to the part's surface."""
    import igl

    origin = part.bounds.mean(0)
    vertices, faces = np.ascontiguousarray(part.vertices - origin), np.array(part.faces)
    squared = igl.point_mesh_squared_distance(np.ascontiguousarray(points - origin), vertices, faces)[0]
    return np.asarray(np.sqrt(squared))


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


def score(
    part: Solid,
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
    after, way = nan, nan
    if found_pose is not None and true_pose is not None:
        after, way = pose_error(part, found_pose, true_pose)
    if true is None or not found:
        empty = true is None and not found
        return Score(float(empty), nan if true is None else -1.0, nan, after)
    origin = part.bounds.mean(0)
    expected, actual = to_manifold(true, origin), union(found, origin)
    if found_pose is not None and true_pose is not None and after < tolerance and way > max(4 * after, tolerance / 4):
        D = found_pose @ np.linalg.inv(true_pose)
        D[:3, 3] += D[:3, :3] @ origin - origin
        expected = expected.transform(np.ascontiguousarray(D[:3]))
    common = (expected ^ actual).volume()
    a, b = expected.volume(), actual.volume()
    differs = max(a + b - 2 * common, 0.0)
    area = inner_area(true, part)
    return Score(common / (a + b - common), b / a - 1, differs / area / tolerance if area else nan, after)
