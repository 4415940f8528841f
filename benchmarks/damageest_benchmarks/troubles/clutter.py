"""Troubles with points that are not on the part: a table, a second specimen, stray clusters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import concatenate_meshes, to_solid
from damageest_benchmarks.troubles.scanner import find_normals
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene
from damageest_benchmarks.troubles.views import DISTANCE, scan_surface


def leave_table(case: Scanning) -> TroubleScene:
    """The part lies on a table, seen from above. With an ordinary damage. ``amount`` 1: clamps hold it too."""
    from manifold3d import Manifold

    left, damage = case.damage("chip")
    low, high = case.part.bounds
    size = high - low
    boxes = [
        Manifold.cube((2 * size[0], 2 * size[1], 4.0)).translate(
            (low[0] - size[0] / 2, low[1] - size[1] / 2, low[2] - 4)
        )
    ]
    if case.amount:
        for side in (low[0] - 10.0, high[0]):
            boxes.append(
                Manifold.cube((10.0, 15.0, size[2] / 2 + 2)).translate((side, low[1] + size[1] / 3, low[2] - 2))
            )
    table = to_solid(Manifold.batch_boolean(boxes, _add_operation()))
    assert table is not None
    return _scan_with(case, left, damage, table, _place_above(case))


def _add_operation() -> Any:
    from manifold3d import OpType

    return OpType.Add


def _place_above(case: Scanning) -> Floats:
    angle = case.make_rng(13).uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(case.views or 3) / (case.views or 3)
    direction = np.column_stack([np.cos(angle), np.sin(angle), np.full(len(angle), 1.0)]) / np.sqrt(2)
    return np.asarray(case.part.bounds.mean(axis=0) + DISTANCE * case.part.diagonal * direction)


def _scan_with(
    case: Scanning, left: Mesh, damage: Solid | None, other: Mesh, scanners: Floats | None = None
) -> TroubleScene:
    """The scan of the part and of another object together."""
    vertices, faces, _ = concatenate_meshes([left, other])
    return replace(case.scan(Mesh(vertices, faces), damage, scanners), added=True)


def add_specimen(case: Scanning) -> TroubleScene:
    """A second specimen of the part stands beside it. With an ordinary damage."""
    from scipy.spatial.transform import Rotation

    left, damage = case.damage("pit")
    turn = Rotation.from_euler("z", 40 + 10 * case.number, degrees=True).as_matrix()
    centre = case.part.bounds.mean(axis=0)
    away = np.array((1.15 * case.part.diagonal, 0, 0))
    return _scan_with(case, left, damage, Mesh((case.part.vertices - centre) @ turn.T + centre + away, case.part.faces))


def add_cluster(case: Scanning) -> TroubleScene:
    """``amount`` stray points in a cluster 1 mm below a face; on the other side of it, all points are intact."""
    return _add_cluster(case, None, None)


def add_cluster_beside_damage(case: Scanning) -> TroubleScene:
    """The same with a damage elsewhere."""
    return _add_cluster(case, *case.damage("chip"))


def _add_cluster(case: Scanning, left: Mesh | None, damage: Solid | None) -> TroubleScene:
    scene = case.scan(left or case.part, damage)
    rng = case.make_rng(14)
    # a place on a face, with metal below, away from the damage
    points, _ = scan_surface(case.part, None, 4000, rng)
    normals = find_normals(case, points)
    middle = points - 1.0 * normals
    depth = distance_to_mesh(middle, case.part)
    good = depth > 0.98
    if damage is not None:
        good &= distance_to_mesh(points, damage) > 12
    k = int(rng.choice(np.flatnonzero(good)))
    spread = 1.2 * rng.normal(size=(int(case.amount), 3))
    spread -= (spread @ normals[k])[:, None] * normals[k]
    stray = middle[k] + spread + rng.normal(scale=case.noise, size=spread.shape)
    return scene.with_points(np.concatenate([scene.points, stray]))
