"""Parts with concave corners, sharp edges, thin walls, bores and gaps, and random damages of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from manifold3d import CrossSection, Manifold

from damageest.artefacts import Deposit, Floats, Part, Solid
from damageest.geometry.solids import to_arrays

TOLERANCE = 0.1
INSET = 5e-4
"""Share of these volumes that goes with the border of the stock, which begins a little inside that of the skin."""


def block() -> Any:
    return Manifold.cube((30, 20, 12))


def bracket() -> Any:
    """Two plates at a right angle: a concave corner."""
    return Manifold.cube((30, 20, 6)) + Manifold.cube((6, 20, 24))


def bored() -> Any:
    return Manifold.cube((30, 20, 12)) - Manifold.cylinder(30, 5, 5, 96, True).translate((15, 10, 0))


def bar() -> Any:
    return Manifold.cylinder(40, 8, 8, 96)


def blade() -> Any:
    """A blade 24 mm wide and at most 1.6 mm thick, its edges sharp, twisted."""
    x = np.linspace(-1, 1, 25)
    half = 0.8 * (1 - x**2)
    outline = np.concatenate([np.column_stack([12 * x, half]), np.column_stack([12 * x, -half])[-2:0:-1]])
    return Manifold.extrude(CrossSection([outline[::-1]]), 30, 20, 15.0)


def dovetail() -> Any:
    """A block with a dovetail groove: acute concave corners."""
    groove = CrossSection([np.array([[-4.0, 0.01], [-7.0, -5.0], [7.0, -5.0], [4.0, 0.01]])])
    return Manifold.cube((30, 30, 12)) - Manifold.extrude(groove, 40).rotate((90, 0, 0)).translate((15, 35, 12))


def comb(gap: float = 3.0) -> Any:
    """Three teeth of 4 mm, ``gap`` apart."""
    body = Manifold.cube((12 + 2 * gap, 14, 5))
    for k in range(3):
        body += Manifold.cube((4, 14, 13)).translate((k * (4 + gap), 0, 0))
    return body


SHAPES: dict[str, Callable[[], Any]] = {
    make.__name__: make for make in (block, bracket, bored, bar, blade, dovetail, comb)
}


def part_of(body: Any) -> Part:
    return Part(*to_arrays(body))


def solid_of(body: Any) -> Solid:
    return Solid(*to_arrays(body))


def make_damage(body: Any, rng: np.random.Generator) -> Any:
    """The damage that a random ball, cube or rough body makes at a random place of a surface."""
    mesh = Part(*to_arrays(body))
    area = np.linalg.norm(mesh.cross, axis=1)
    for _ in range(100):
        corner = mesh.triangles[rng.choice(len(area), p=area / area.sum())]
        place = rng.dirichlet((1, 1, 1)) @ corner
        size = rng.uniform(2, 5)
        ball, cube = Manifold.sphere(size, 48), Manifold.cube((2 * size, 2 * size, 2 * size), True)
        tool = ball if rng.random() < 0.5 else cube
        if rng.random() < 0.5:
            tool = tool.refine_to_length(0.8).warp_batch(lambda p: p + 0.15 * np.sin(2.3 * p[:, [1, 2, 0]] + 1.0))
        turned = tool.rotate(tuple(rng.uniform(0, 360, 3))).translate(tuple(place))
        lost = body ^ turned
        if 5 < lost.volume() < 0.4 * body.volume():
            return lost
    raise AssertionError("no damage could be made")


def skin_points(lost: Solid, part: Part, count: int, seed: int) -> tuple[Floats, Floats]:
    """Random points (N,3) on the faces of a damage that lie on the part, and the part's normal (N,3) there."""
    import trimesh

    mesh = trimesh.Trimesh(lost.vertices, lost.faces, process=False)
    points, _ = trimesh.sample.sample_surface(mesh, 4 * count, seed=seed)
    distance, face = nearest(points, part)
    cross = part.cross[face[distance < 1e-6]]
    return points[distance < 1e-6][:count], (cross / np.linalg.norm(cross, axis=1)[:, None])[:count]


def nearest(points: Floats, mesh: Any) -> tuple[Floats, Any]:
    """Distance (N,) to a mesh, and the nearest of its triangles (N,)."""
    import igl

    squared, face, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces)
    )
    return np.sqrt(squared), face


def inside(points: Floats, solid: Any) -> Any:
    """(N,) by winding number."""
    import igl

    if not len(points):
        return np.zeros(0, bool)
    return (
        igl.fast_winding_number(
            np.ascontiguousarray(solid.vertices), np.ascontiguousarray(solid.faces), np.ascontiguousarray(points)
        )
        > 0.5
    )


def deposit_on(body: Any, tool: Any, others: Solid | None = None, part: Part | None = None, **chosen: Any) -> Deposit:
    """The deposit for what a tool takes off a body."""
    from damageest.stages.allowance.milling import Milling

    lost = solid_of(body ^ tool)
    deposit = Milling.model_validate(chosen).run(lost, part or part_of(body), TOLERANCE, others)
    assert isinstance(deposit, Deposit)
    return deposit
