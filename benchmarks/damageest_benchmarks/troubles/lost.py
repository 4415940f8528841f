"""Troubles with metal that is lost: altogether, out of sight, or in shapes that are hard to see."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Solid
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest_benchmarks.troubles.parts import WALL_HEIGHT
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene
from damageest_benchmarks.troubles.views import place_scanners, scan_surface


def make_box(low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    """The box between two corners, as a Manifold."""
    from manifold3d import Manifold

    return Manifold.cube(tuple(np.subtract(high, low))).translate(low)


def lose_wall(case: Scanning) -> TroubleScene:
    """The upright wall of `wall_plate` is gone altogether. ``amount``: its thickness in tolerances."""
    return case.scan(*case.cut(make_box((-50, -10, 0), (50, 14, 2 * WALL_HEIGHT))))


def bite_wall(case: Scanning) -> TroubleScene:
    """A bite of 6 mm out of the upper edge of a wall. ``amount``: its thickness in tolerances."""
    from manifold3d import Manifold

    x = float(case.make_rng(2).uniform(-18, 18))
    bite = Manifold.cylinder(20, 6, 6, 96, True).rotate((90, 0, 0)).translate((x, 2, WALL_HEIGHT))
    return case.scan(*case.cut(bite))


def lose_rib(case: Scanning) -> TroubleScene:
    """A rib is gone altogether."""
    boxes = {
        "rib_bracket": ((-35, 2.4, 0), (-3, 5.1, 32)),
        "ribbed_plate": ((-28.5, 12.4, 0), (45.1, 15.6, 20)),
    }
    return case.scan(*case.cut(make_box(*boxes[case.name])))


def lose_pin(case: Scanning) -> TroubleScene:
    """A pin (`pin_plate`) or a bar (`grille`) is gone altogether."""
    boxes = {"pin_plate": ((-18, 2, 0), (-12, 8, 20)), "grille": ((-2.01, -29, -6), (2.01, 29, 0))}
    return case.scan(*case.cut(make_box(*boxes[case.name])))


def lose_body(case: Scanning) -> TroubleScene:
    """One of the two bodies of `two_blocks` is lost. ``amount`` 1: the larger one."""
    box = make_box((-5, -5, -5), (55, 45, 25)) if case.amount else make_box((60, -5, -5), (90, 45, 25))
    return case.scan(*case.cut(box))


def hide_damage(case: Scanning) -> TroubleScene:
    """A damage on the side that was not scanned."""
    for number in range(5):
        left, damage = case.damage("pit", number)
        for turn in range(12):
            scanners = place_scanners(case.part, case.views or 3, case.make_rng(100 + 12 * number + turn))
            points = scan_surface(left, scanners, 4000, case.make_rng(3))[0]
            if not (distance_to_mesh(points, case.part) > 1e-6 * case.part.diagonal).any():
                return case.scan(left, damage, scanners)
    raise StageError("the damage is seen from all directions")


def shade_damage(case: Scanning) -> TroubleScene:
    """The skin on one side of the damage has no points. ``amount`` 0: the border runs along the rim; above: into it."""
    for number in range(12):
        left, damage = case.damage("pit", number)
        scene = case.scan(left, damage)
        for direction in np.concatenate([np.eye(3), -np.eye(3)]):
            along = damage.vertices @ direction
            dropped = scene.points @ direction > along.max() - (case.amount - 0.03) * (along.max() - along.min())
            if 0.05 < dropped.mean() < 0.4:
                return _drop_points(scene, dropped)
    raise StageError("the part has no place for a damage beside skin that is not scanned")


def _drop_points(scene: TroubleScene, dropped: Flags) -> TroubleScene:
    kept = ~dropped
    view = None if scene.view is None else scene.view[kept]
    return replace(scene, points=scene.points[kept], view=view, seen=scene.seen * float(kept.mean()))


def lose_deep_hole(case: Scanning) -> TroubleScene:
    """A hole 3 mm wide and 14 mm deep: no scanner position sees its bottom."""
    from manifold3d import Manifold

    rng = case.make_rng(4)
    low, high = case.part.bounds[:, :2]
    x, y = (low + high) / 2 + np.array((0.2, -0.22)) * (high - low) + rng.uniform(-2, 2, 2)
    return case.scan(*case.cut(Manifold.cylinder(28, 1.5, 1.5, 64, True).translate((x, y, case.part.bounds[1, 2]))))


def cut_narrow_groove(case: Scanning) -> TroubleScene:
    """A groove 20 mm long and 2 mm deep in the top face. ``amount``: its width in tolerances."""
    return case.scan(*case.cut(_make_top_box(case, (20, case.amount * case.tolerance, 4), 0)))


def _make_top_box(case: Scanning, size: tuple[float, ...], offset: float) -> Any:
    """A box with its centre in the top face of the part, moved along y."""
    from manifold3d import Manifold

    x, y, z = _find_place(case)
    return Manifold.cube(size, True).translate((x, y + offset, z))


def _find_place(case: Scanning) -> tuple[float, float, float]:
    """A place in the part's top face with 5 mm of metal all round."""
    x, y = {"block": (-19.0, -10.5), "cuboid": (5.0, 3.0), "plate": (-6.0, 2.0)}[case.name]
    return x, y, float(case.part.bounds[1][2])


def leave_thin_wall(case: Scanning) -> TroubleScene:
    """Two pockets of 8 mm, apart by a wall of ``amount`` tolerances."""
    step = 8 + case.amount * case.tolerance
    pockets = _make_top_box(case, (12, 8, 5), -step / 2) + _make_top_box(case, (12, 8, 5), step / 2)
    return case.scan(*case.cut(pockets))


def make_shallow_pit(case: Scanning) -> TroubleScene:
    """A pit in the top face, 10 mm across. ``amount``: its depth in tolerances."""
    from manifold3d import Manifold

    depth = case.amount * case.tolerance
    radius = (5**2 + depth**2) / (2 * depth)
    cap = Manifold.sphere(radius, 512).translate((0, 0, radius - depth)) ^ Manifold.cube((30, 30, 2), True)
    x, y, z = _find_place(case)
    return case.scan(*case.cut(cap.translate((x, y, z))))


def wear_face(case: Scanning) -> TroubleScene:
    """Wear of ``amount`` tolerances on the top face."""
    low, high = case.part.bounds
    box = make_box((*(low[:2] - 1), high[2] - case.amount * case.tolerance), tuple(high + 1))
    return case.scan(*case.cut(box))


def take_damage(case: Scanning) -> TroubleScene:
    """An ordinary damage. ``amount``: the number of its kind."""
    kind = ("chip", "pit", "cut", "end", "groove", "hole")[int(case.amount)]
    left, damage = case.damage(kind)
    return case.scan(left, damage)


def crack(case: Scanning) -> TroubleScene:
    """Broken in two; both pieces are in the scan. ``amount``: how far the smaller one has moved away, in mm."""
    from manifold3d import Manifold

    rng = case.make_rng(5)
    normal = rng.normal(size=3) * (0.15, 0.15, 0.15) + (1, 0, 0)
    normal /= np.linalg.norm(normal)
    body = to_manifold(case.part)
    along = case.part.vertices @ normal
    place = float(along.min() + 0.72 * (along.max() - along.min()))
    piece, rest = body.split_by_plane(tuple(normal), place)
    side = np.cross(normal, (0, 0, 1))
    moved = piece.translate(tuple(case.amount * (normal + 0.2 * side / np.linalg.norm(side))))
    left = Manifold.compose([rest, moved])
    mesh = Solid(*to_arrays(left))
    return replace(case.scan(mesh, to_solid(body - left)), added=True)
