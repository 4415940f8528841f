"""Scores of a result: solids are compared by Booleans in float64, poses by the displacement of the part's surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.skin import extract_ids
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.transforms import move_mesh, move_points

MATCH = 0.1
"""Least share of a true damage's volume inside found sites, for it to count as found; and least share of a site's
volume inside true damage, for it not to count as a false site. The distances measure how well it was found."""
SAMPLES = 10_000
"""Points on each inner damage surface whose distance to the other surface is measured."""


@dataclass(frozen=True)
class Score:
    """The score of a result; a value is NaN if there is nothing to compare.

    ``iou``: intersection over union of found and true damage. ``volume_error``: found volume / true volume - 1.
    ``surface_error``: volume of the symmetric difference / area of the true inner damage surface, in tolerances.
    ``pose_error``: rms distance to the part of the part's surface, moved by the error of the pose. ``distance_median``,
    ``distance_95``, ``distance_max``: distances between the found and the true inner damage surface, in both
    directions, of points deeper than the tolerance. ``found``, ``missed``: numbers of true damages. ``false_sites``:
    number of found sites without true damage.
    """

    iou: float
    volume_error: float
    surface_error: float
    pose_error: float
    distance_median: float = float("nan")
    distance_95: float = float("nan")
    distance_max: float = float("nan")
    found: int = 0
    missed: int = 0
    false_sites: int = 0


def unite_solids(solids: Sequence[Solid], origin: Floats) -> Any:
    """The union of solids as a ``manifold3d.Manifold``, relative to ``origin`` (3,)."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean([to_manifold(solid, origin) for solid in solids], OpType.Add)


def iou(found: Sequence[Solid], true: Sequence[Solid]) -> float:
    """Intersection over union of two sets of solids, each taken as its union; 1 if both are empty."""
    if not found or not true:
        return float(not found and not true)
    origin = true[0].bounds.mean(0)
    a, b = unite_solids(found, origin), unite_solids(true, origin)
    common = (a ^ b).volume()
    return float(common / (a.volume() + b.volume() - common))


def sample_surface(part: Mesh, count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Random points (count,3), uniform by area, and their outward normals (count,3)."""
    rng = np.random.default_rng([811, seed])
    length = 2 * part.face_areas
    face = rng.choice(len(length), count, p=length / length.sum())
    share = rng.dirichlet(np.ones(3), count)
    return np.einsum("ij,ijk->ik", share, part.triangles[face]), part.cross[face] / length[face, None]


def measure_pose_error(part: Mesh, found: Floats, true: Floats) -> tuple[float, float]:
    """(residual, path): rms distances of the part's surface, moved by the error of pose ``found`` (4,4).

    ``residual``: to the part; ``path``: to where it was. On a symmetric part, the path of a right pose may be long, but
    its residual is small.
    """
    points = sample_surface(part, 4000)[0]
    D = found @ np.linalg.inv(true)
    moved = move_points(points, D)
    path = np.linalg.norm(moved - points, axis=1)
    return float(np.sqrt((distance_to_mesh(moved, part) ** 2).mean())), float(np.sqrt((path**2).mean()))


def measure_depth(damage: Mesh, part: Mesh) -> float:
    """The largest distance of the damage from the part's surface."""
    points = np.concatenate([damage.vertices, sample_surface(damage, 2000)[0]])
    return float(distance_to_mesh(points, part).max())


def measure_distances(found: Mesh, true: Mesh, part: Mesh, tolerance: float) -> Floats:
    """(M,) distances between two surfaces, in both directions, at points that are uniform by area.

    Only those of ``SAMPLES`` points on each surface that are deeper than the tolerance below the part's skin. Shallower
    points, as along the rim, are intact by definition, so that the end of the surface is not determined there.
    """
    values = []
    for seed, (mesh, other) in enumerate(((found, true), (true, found)), 1):
        points = sample_surface(mesh, SAMPLES, seed)[0]
        values.append(distance_to_mesh(points[distance_to_mesh(points, part) > tolerance], other))
    return np.concatenate(values)


def count_matches(
    found: Sequence[Any], true: Any, part: Mesh, tolerance: float, origin: Floats
) -> tuple[int, int, int]:
    """(found, missed, false_sites): connected bodies of the true damage found and missed, and sites without damage.

    ``found`` and ``true`` are Manifolds relative to ``origin`` (3,). A body no deeper than the tolerance is no damage
    by definition.
    """
    from manifold3d import Manifold, OpType

    everything = Manifold.batch_boolean([Manifold(), *found], OpType.Add)
    hits = []
    for piece in true.decompose():
        solid = to_solid(piece, origin)
        if solid is not None and measure_depth(solid, part) > tolerance:
            hits.append((piece ^ everything).volume() >= MATCH * piece.volume())
    false_sites = sum((site ^ true).volume() < MATCH * site.volume() for site in found)
    return sum(hits), len(hits) - sum(hits), false_sites


def score(
    part: Part,
    found: Sequence[Solid],
    true: Solid | None,
    tolerance: float,
    found_pose: Floats | None = None,
    true_pose: Floats | None = None,
) -> Score:
    """Compares the union of ``found`` with the ``true`` damage. Poses are ``T_part_scan`` (4,4).

    If the found pose maps a symmetric part onto itself in another position, the true damage is moved to that position.
    Small errors of the pose are not corrected: they increase the errors of the damage.
    """
    nan = float("nan")
    residual, path, D = nan, nan, np.eye(4)
    if found_pose is not None and true_pose is not None:
        residual, path = measure_pose_error(part, found_pose, true_pose)
        if residual < tolerance and path > max(4 * residual, tolerance / 4):
            D = found_pose @ np.linalg.inv(true_pose)
    origin = part.bounds.mean(0)
    if true is None:
        return Score(float(not found), nan, nan, residual, false_sites=len(found))
    moved = move_mesh(true, D)
    expected, sites = to_manifold(moved, origin), [to_manifold(solid, origin) for solid in found]
    counts = count_matches(sites, expected, part, tolerance, origin)
    if not found:
        return Score(0.0, -1.0, nan, residual, nan, nan, nan, *counts)
    actual = unite_solids(found, origin)
    common = (expected ^ actual).volume()
    a, b = expected.volume(), actual.volume()
    differs = max(a + b - 2 * common, 0.0)
    # faces on the skin are recognised in the frame in which they lie on the part
    true_ids = extract_ids(true, part)
    found_ids = extract_ids(whole, part) if (whole := to_solid(actual, origin)) else None
    quantiles = (nan, nan, nan)
    if found_ids is not None and len(found_ids.faces) and len(true_ids.faces):
        other = move_mesh(true_ids, D)
        gaps = measure_distances(found_ids, other, part, tolerance)
        quantiles = (
            (float(np.median(gaps)), float(np.quantile(gaps, 0.95)), float(gaps.max())) if len(gaps) else quantiles
        )
    surface = differs / true_ids.area / tolerance if true_ids.area else nan
    return Score(common / (a + b - common), b / a - 1, surface, residual, *quantiles, *counts)
