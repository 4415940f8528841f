"""A damaged part with known truth: a prism with two round dents, its scan, and the artefacts of all stages.

The prism, 16 x 12 x 8 with one edge cut off, has no symmetry, so that its pose is unique. The damage is the
intersection with a ball at its top, and with a smaller ball at its bottom.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from damageest.artefacts import (
    DAMAGE,
    INTACT,
    Deviation,
    Floats,
    Mesh,
    Part,
    Pose,
    Rims,
    Samples,
    Scan,
    Sites,
    Solid,
    Surface,
)
from damageest.geometry.solids import to_arrays, to_manifold, to_solid

TOLERANCE = 0.2
NOISE = 0.02
"""Standard deviation of the scan points along the normal."""
DENSITY = 25.0
"""Scan points per unit of area."""
SPACING = 0.22
"""Mean distance between neighbouring scan points."""
OUTLINE = np.array([[-8, -6], [8, -6], [8, 1], [3, 6], [-8, 6]], dtype=float)
HALF_HEIGHT = 4.0
DENTS = ((np.array([-3.0, -1.0, 5.2]), 3.0), (np.array([3.0, -2.0, -4.8]), 2.0))
"""Centre (3,) and radius of each ball: top, bottom. The slopes of the dents are below 70 degrees."""
SECTIONS = 96
"""Vertices of the rim of a dent or a bore."""


def transform(value: Any, scale: float, turn: Floats, shift: Floats) -> Any:
    """An artefact, points (N,3) or a length; scaled, then turned, then shifted."""
    match value:
        case Mesh():
            return replace(value, vertices=scale * value.vertices @ turn.T + shift)
        case Samples():
            points = scale * value.points @ turn.T + shift
            return replace(value, points=points, normals=value.normals @ turn.T, spacing=scale * value.spacing)
        case Scan():
            normals = None if value.normals is None else value.normals @ turn.T
            points = scale * value.points @ turn.T + shift
            return replace(
                value, points=points, normals=normals, noise=scale * value.noise, spacing=scale * value.spacing
            )
        case Deviation():
            return replace(value, distance=scale * value.distance)
        case float():
            return scale * value
        case np.ndarray():
            return scale * value @ turn.T + shift
        case _:
            return value


def make_prism() -> Part:
    """The part as designed, 10 vertices."""
    count = len(OUTLINE)
    flat = np.concatenate([np.column_stack([OUTLINE, np.full(count, z)]) for z in (-HALF_HEIGHT, HALF_HEIGHT)])
    faces = []
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, count + j), (i, count + j, count + i)]
    for i in range(1, count - 1):
        faces += [(0, i + 1, i), (count, count + i, count + i + 1)]
    return Part(flat, np.array(faces))


def revolve(radius: Floats, height: Floats, centre: Floats, tip: bool) -> Surface:
    """A profile of ``radius`` (N,) and ``height`` (N,), revolved about the z axis through ``centre`` (3,).

    The normals of a rising profile point to the axis. The vertices of the last ring come first. ``tip``: the profile
    starts with a point on the axis, which becomes the last vertex.
    """
    angle = 2 * np.pi * np.arange(SECTIONS) / SECTIONS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    start = 1 if tip else 0
    rings = [
        np.column_stack([r * circle, np.full(SECTIONS, z)])
        for r, z in zip(radius[start:][::-1], height[start:][::-1], strict=True)
    ]
    i = np.arange(SECTIONS)
    j = (i + 1) % SECTIONS
    faces = []
    for k in range(len(rings) - 1):
        low, high = (k + 1) * SECTIONS, k * SECTIONS
        faces += [np.stack([low + i, high + i, low + j], 1), np.stack([low + j, high + i, high + j], 1)]
    vertices = np.concatenate(rings)
    if tip:
        last = (len(rings) - 1) * SECTIONS
        faces.append(np.stack([np.full(SECTIONS, len(vertices)), last + i, last + j], 1))
        vertices = np.concatenate([vertices, [[0.0, 0.0, height[0]]]])
    return Surface(vertices + centre, np.concatenate(faces))


def make_bowl(short: float = TOLERANCE) -> Surface:
    """The surface of the dent on top, with normals upward. The vertices of the rim come first.

    The rim is ``short`` below the skin, because segmentation labels shallower points as intact.
    """
    centre, radius = DENTS[0]
    polar = np.linspace(0, np.arccos((centre[2] - HALF_HEIGHT + short) / radius), 24)
    return revolve(radius * np.sin(polar), -radius * np.cos(polar), centre, True)


BORE = 2.0
"""Radius of the worn-through bore."""


def make_bore(short: float = TOLERANCE) -> Surface:
    """The wall of a hole of radius BORE through the prism, with normals to its axis.

    The vertices of the two rims come first and last. The rims are ``short`` below the skin.
    """
    height = np.linspace(-HALF_HEIGHT + short, HALF_HEIGHT - short, 24)
    return revolve(np.full(24, BORE), height, np.array([-3.0, -1.0, 0.0]), False)


def make_box(low: Floats, high: Floats, edge: float) -> Solid:
    """A box whose edges are no longer than ``edge``."""
    from manifold3d import Manifold

    body = Manifold.cube(tuple(high - low)).translate(tuple(low))
    return Solid(*to_arrays(body.refine_to_length(edge)))


def make_dent(number: int) -> Solid:
    """The damage volume of one dent."""
    from manifold3d import Manifold

    centre, radius = DENTS[number]
    lost = to_solid(Manifold.sphere(radius, 128).translate(tuple(centre)) ^ to_manifold(make_prism()))
    assert lost is not None
    return lost


def sample_points(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Random points (N,3) on a mesh, uniform by area, and their normals (N,3)."""
    area = 2 * mesh.face_areas
    face = rng.choice(len(area), count, p=area / area.sum())
    u, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    a, b, c = np.moveaxis(mesh.triangles[face], 1, 0)
    return a * (1 - u) + b * u * (1 - v) + c * u * v, mesh.cross[face] / area[face, None]


@lru_cache
def make_scene() -> SimpleNamespace:
    """The part, its scan and the artefacts of all stages, in the part's frame."""
    from damageest.geometry.distance import signed_distance
    from damageest.geometry.skin_near import NearCubes, find_cubes_near, sample_near
    from damageest.stages.sample.edge_aware import EdgeAware

    rng = np.random.default_rng(7)
    part = make_prism()
    points, normals = sample_points(part, int(DENSITY * part.area), rng)
    is_intact = np.all([np.linalg.norm(points - centre, axis=1) > radius for centre, radius in DENTS], axis=0)
    points, normals, site = points[is_intact], normals[is_intact], np.zeros(is_intact.sum(), np.int32)
    for number, (centre, radius) in enumerate(DENTS, 1):
        up = np.abs(centre[2]) - HALF_HEIGHT
        count = int(DENSITY * 2 * np.pi * radius * (radius - up))
        steep, turn = rng.uniform(up / radius, 1, count), rng.uniform(0, 2 * np.pi, count)
        wide = np.sqrt(1 - steep**2)
        direction = np.column_stack([wide * np.cos(turn), wide * np.sin(turn), -np.sign(centre[2]) * steep])
        points, normals = np.concatenate([points, centre + radius * direction]), np.concatenate([normals, -direction])
        site = np.append(site, np.full(len(direction), number, np.int32))
    points = points + NOISE * rng.normal(size=len(points))[:, None] * normals
    order = rng.permutation(len(points))
    points, normals, site = points[order], normals[order], site[order]
    distance, face = signed_distance(points, part)
    damage = distance < -TOLERANCE
    site = np.where(damage, site, 0).astype(np.int32)
    feet = points[damage] - distance[damage, None] * part.face_normals[face[damage]]
    near, _ = find_cubes_near(part, points[damage], feet, points[~damage], 20 * TOLERANCE)
    surface = make_bowl()
    low, high = part.bounds
    clear = 2 * TOLERANCE
    return SimpleNamespace(
        part=part,
        scan=Scan(points, normals, noise=NOISE, spacing=SPACING),
        aligned=Scan(points, normals, noise=NOISE, spacing=SPACING),
        samples=EdgeAware().run(part=part, tolerance=TOLERANCE),
        nearby=sample_near(part, near, NearCubes.around(points[damage], 6 * TOLERANCE), TOLERANCE),
        deviation=Deviation(distance, face, np.where(damage, DAMAGE, INTACT).astype(np.uint8)),
        sites=Sites(site, len(DENTS)),
        intact=points[~damage],
        points=points[site == 1],
        surface=surface,
        rims=Rims((np.arange(SECTIONS),)),
        background=make_box(low - clear, high + clear, 3 * TOLERANCE),
        pose=Pose(np.eye(4)),
        tolerance=TOLERANCE,
        spacing=SPACING,
        noise=NOISE,
        fine=True,
        unit="mm",
    )


def find_boundary_edges(faces: Any) -> set[tuple[int, int]]:
    """The directed boundary edges of faces (F,3)."""
    edges = {tuple(edge) for edge in np.asarray(faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    return {(a, b) for a, b in edges if (b, a) not in edges}
