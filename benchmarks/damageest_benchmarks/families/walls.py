"""Thin walls: a pit in a wall of .6 to 8 mm that is scanned from outside, from inside, or from both sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Scan, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_solid
from damageest.geometry.vectors import normalise
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out, to_part
from damageest_benchmarks.troubles.views import find_visible, scan_surface

PITS = ("bowl", "flat floor", "groove", "worn patch", "chip")
SIDES = ("outside", "inside", "both")
WHOLE = 0.98
"""Share of the damage and of its rim that the scanner has to see."""
MOST_POINTS = 120_000
TOLERANCES = 4.0
"""The job's tolerance, in noises."""


@dataclass(frozen=True, eq=False)
class Wall:
    """A body (Manifold) with a wall.

    ``place`` (3,) on its outer skin, where the pit is; ``out``: the outward normal there; ``along``: a direction within
    the wall. ``edge``: a place on an edge of the wall. ``inner``: scanner positions (V,3) from which its inner skin is
    seen; None: the mirror images of the outer ones.
    """

    body: Any
    place: Floats
    out: Floats
    along: Floats
    edge: Floats
    inner: Floats | None = None


def _box(x: float, y: float, z: float) -> Any:
    from manifold3d import Manifold

    return Manifold.cube((x, y, z), True)


def _make_plate(t: float, rng: np.random.Generator) -> Wall:
    x, y = rng.uniform(40, 90, 2)
    body = _box(x, y, t) - _box(12, 12, 3 * t).translate((x / 2, y / 2, 0))
    body -= _box(8, 5, 3 * t).translate((-x / 2, 0.2 * y, 0))
    place = np.array([*rng.uniform(-0.15, 0.15, 2) * (x, y), t / 2])
    return Wall(body, place, np.array([0.0, 0, 1]), np.array([1.0, 0, 0]), np.array([0, -y / 2, t / 2]))


def _make_pipe(t: float, rng: np.random.Generator) -> Wall:
    from manifold3d import Manifold

    radius, length = rng.uniform(12, 25), rng.uniform(30, 60)
    body = Manifold.cylinder(length, radius, radius, 128, True) - Manifold.cylinder(
        2 * length, radius - t, radius - t, 128, True
    )
    body -= _box(10, 10, 12).translate((-radius, 0, length / 2))  # so that no turn leaves it as it is
    angle = rng.uniform(-0.5, 0.5)
    out = np.array([np.cos(angle), np.sin(angle), 0])
    inner = np.array([[-0.3 * radius, 0, k * 1.2 * length] for k in (-1, 1)])
    return Wall(body, radius * out, out, np.array([0.0, 0, 1]), radius * out - [0, 0, length / 2], inner)


def _make_housing(t: float, rng: np.random.Generator) -> Wall:
    x, y, z = rng.uniform(35, 60, 3)
    body = (
        _box(x, y, z)
        - _box(x - 2 * t, y - 2 * t, z).translate((0, 0, t))
        + _box(10, 8, 12).translate((0, -y / 2 - 4 + t / 2, 0))
    )
    place = np.array([*rng.uniform(-0.15, 0.15, 2) * (x, y), -z / 2])
    inner = np.array([[0.3 * a * x, 0.3 * b * y, 2 * z] for a, b in ((-1, 0), (1, 0.3), (0, -1), (0.2, 1))])
    return Wall(body, place, np.array([0, 0, -1.0]), np.array([1.0, 0, 0]), np.array([0, y / 2, -z / 2]), inner)


def _make_blade(t: float, rng: np.random.Generator) -> Wall:
    from manifold3d import CrossSection, Manifold

    radius, height, turn = rng.uniform(30, 60), rng.uniform(40, 70), 0.55
    angles = np.linspace(-turn, turn, 40)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    body = Manifold.extrude(CrossSection([np.concatenate([arc * (radius + t), arc[::-1] * radius])]), height)
    body = body.translate((0, 0, -height / 2)) + _box(14, 40, 8).translate((radius, 4, -height / 2 - 3))
    angle = rng.uniform(-0.2, 0.2)
    out = np.array([np.cos(angle), np.sin(angle), 0])
    return Wall(
        body, (radius + t) * out + [0, 0, 5], out, np.array([0.0, 0, 1]), (radius + t) * out + [0, 0, height / 2]
    )


def _make_bend(t: float, rng: np.random.Generator) -> Wall:
    from manifold3d import CrossSection, Manifold

    a, b, width, r = rng.uniform(30, 50), rng.uniform(20, 40), rng.uniform(30, 60), t + 2.0
    turn = np.linspace(0, np.pi / 2, 16)
    round_ = np.column_stack([np.cos(turn), np.sin(turn)])
    outline = np.concatenate([[(-a, r), (-a, r - t)], (round_ * (r - t))[::-1], [(r - t, -b), (r, -b)], round_ * r])
    body = Manifold.extrude(CrossSection([outline]), width)
    body -= Manifold.cylinder(10 * r, 4, 4, 48, True).rotate((90, 0, 0)).translate((-0.8 * a, 0, 0.2 * width))
    place = np.array([-a * rng.uniform(0.35, 0.55), r, width * rng.uniform(0.45, 0.6)])
    return Wall(body, place, np.array([0, 1.0, 0]), np.array([1.0, 0, 0]), np.array([-a / 2, r, width]))


def _make_fin(t: float, rng: np.random.Generator) -> Wall:
    x, height = rng.uniform(40, 70), rng.uniform(18, 30)
    body = _box(x + 10, 30, 10).translate((0, 0, -5)) + _box(x, t, height + 1).translate((0, 0, height / 2 - 0.5))
    body -= _box(8, 8, 30).translate((x / 2 + 5, 15, 0))
    place = np.array([rng.uniform(-0.15, 0.15) * x, -t / 2, height * rng.uniform(0.45, 0.6)])
    return Wall(body, place, np.array([0, -1.0, 0]), np.array([1.0, 0, 0]), np.array([0, -t / 2, height]))


BODIES: Mapping[str, Callable[[float, np.random.Generator], Wall]] = {
    "plate": _make_plate, "pipe": _make_pipe, "housing": _make_housing, "blade": _make_blade,
    "bent sheet": _make_bend, "fin": _make_fin,
}  # fmt: skip


def _place(tool: Any, wall: Wall, at: Floats) -> Any:
    """A tool whose axis is z, moved so that z is the outward normal and x runs along the wall."""
    across = np.cross(wall.out, wall.along)
    return tool.transform(np.column_stack([wall.along, across, wall.out, at]))


def make_pit(kind: str, wall: Wall, depth: float, rng: np.random.Generator) -> Any:
    """What is cut from the wall's outer skin, as a Manifold."""
    from manifold3d import Manifold

    wide = rng.uniform(3.0, 7.0)
    if kind == "flat floor":
        tool = Manifold.cylinder(3 * depth, wide, wide + 1.2 * depth, 64).translate((0, 0, -depth))
    elif kind == "groove":
        radius = max(depth, wide / 3)
        tool = (
            Manifold.cylinder(3 * wide, radius, radius, 64, True).rotate((0, 90, 0)).translate((0, 0, radius - depth))
        )
    elif kind == "chip":
        tool = _box(2 * wide, 2 * wide, 2 * wide).rotate((0, 0, rng.uniform(0, 90))).translate((0, 0, wide - depth))
        return _place(tool, wall, wall.edge)
    else:
        flat = (1.0, rng.uniform(0.7, 1.3)) if kind == "worn patch" else (1.0, 1.0)
        wide *= 1.4 if kind == "worn patch" else 1.0
        radius = (wide**2 + depth**2) / (2 * depth)  # a cap that is `wide` in radius and `depth` deep
        tool = (
            Manifold.sphere(radius, 512 if radius > 20 else 192).translate((0, 0, radius - depth)).scale((*flat, 1.0))
        )
        tool ^= _box(4 * wide, 4 * wide, 4 * wide)
    return _place(tool, wall, wall.place)


def _place_scanners(wall: Wall, side: str, size: float, rng: np.random.Generator) -> Floats:
    across = np.cross(wall.out, wall.along)
    tilts = [(0.0, 0.0), (0.7, 0.1), (-0.6, 0.3), (0.1, -0.7), (0.0, 0.6)]
    ways = normalise(
        np.array([wall.out + a * wall.along + b * across for a, b in tilts]) + rng.normal(scale=0.05, size=(5, 3))
    )
    outer = wall.place + 3 * size * ways
    inner = (
        wall.place + 3 * size * (ways - 2 * (ways @ wall.out)[:, None] * wall.out) if wall.inner is None else wall.inner
    )
    return {"outside": outer, "inside": inner, "both": np.concatenate([outer, inner])}[side]


def is_shown(part: Mesh, left: Mesh, damage: Solid, scanners: Floats, spacing: float) -> bool:
    """Whether rays from the scanners reach the damage's inner surface and a rim of four spacings round it.

    The rim is skin that faces as the lost skin beside it does: the other side of the wall is none.
    """
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(5)
    lost, of_lost = sample_by_area(damage, 20_000, rng)
    is_skin = distance_to_mesh(lost, part) < 1e-6 * part.diagonal
    lost, lost_normals = lost[is_skin], normalise(damage.cross[of_lost[is_skin]])
    points, face = sample_by_area(left, 200_000, rng)
    low, high = damage.bounds + np.array([[-4.0], [4.0]]) * spacing
    is_near = ((points > low) & (points < high)).all(axis=1)
    points, normals = points[is_near], normalise(left.cross[face[is_near]])
    gap, nearest = cKDTree(lost).query(points, distance_upper_bound=4 * spacing)
    faces_out = np.einsum("ij,ij->i", normals, lost_normals[np.minimum(nearest, len(lost) - 1)]) > 0.5
    is_inner = distance_to_mesh(points, damage) < 1e-6 * part.diagonal
    is_rim = np.isfinite(gap) & faces_out & ~is_inner
    caster = RayCaster(left)
    return all(
        some.any() and find_visible(caster, left, points[some], normals[some], scanners).any(axis=1).mean() >= WHOLE
        for some in (is_inner, is_rim)
    )


def draw_wall(seed: int) -> Draw:
    """A draw of the family. The pit is in the outer skin: a scan from inside alone does not show it."""
    rng = np.random.default_rng([8101, seed])
    body, pit, side = (
        list(BODIES)[seed % len(BODIES)],
        PITS[seed // 6 % len(PITS)],
        SIDES[int(rng.choice(3, p=(0.5, 0.15, 0.35)))],
    )
    thickness, share = float(np.exp(rng.uniform(np.log(0.6), np.log(8)))), float(rng.uniform(0.15, 0.95))
    spacing = float(np.exp(rng.uniform(np.log(0.3), np.log(1.5))))
    given, known, normals = (bool(rng.random() < p) for p in (0.5, 0.4, 0.4))
    wall = BODIES[body](thickness, rng)
    depth = share * thickness
    cutter = make_pit(pit, wall, depth, rng)
    part = to_part(Mesh(*to_arrays(wall.body)), body)
    left = Mesh(*to_arrays(wall.body - cutter))
    damage = to_solid(wall.body ^ cutter, np.zeros(3))
    assert damage is not None
    scanners = _place_scanners(wall, side, part.diagonal, rng)
    trial, face = sample_by_area(left, 20_000, rng)
    seen = find_visible(RayCaster(left), left, trial, normalise(left.cross[face]), scanners).any(axis=1).mean()
    area = left.area * float(seen)
    count = int(np.clip(area / spacing**2, 400, MOST_POINTS))
    noise = 0.05 * spacing
    points, view = scan_surface(left, scanners, count, rng)
    own = None
    if normals:
        from damageest.geometry.distance import closest_on_mesh

        own = normalise(left.cross[closest_on_mesh(points, left)[1]])
    scan = Scan(
        points + rng.normal(scale=noise, size=points.shape), unit="mm", normals=own,
        viewpoints=scanners if given else None, view=None if view is None or not given else view.astype(np.int32),
    )  # fmt: skip
    pose = np.eye(4)
    if not known:
        scan, pose = move_out(scan, draw_motion(rng, part.diagonal))
    said: dict[str, str | float] = {
        "body": body,
        "pit": pit,
        "side": side,
        "wall": thickness,
        "depth": depth,
        "spacing": spacing,
        "points": count,
    }
    said |= {"scanners": given, "pose": "known" if known else "unknown", "normals": normals}
    tolerance = float(f"{max(TOLERANCES * noise, 0.02):.3g}")
    shown = depth > 2 * tolerance and is_shown(part, left, damage, scanners, spacing)
    known_depth = float("nan") if pit == "chip" else depth  # of a chip it depends on the face that it is asked from
    return Draw(part, scan, damage, pose, tolerance, known_depth, shown, ("align=none",) if known else (), said)
