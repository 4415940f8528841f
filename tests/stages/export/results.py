"""A small result with two sites, in a pose that is none of a box's symmetries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from damageest.artefacts import Deviation, Evidence, Part, Pose, Scan, Solid, Surface
from damageest.geometry.solids import subtract_lost, to_manifold, to_solid, unite
from damageest.result import Result, Site


def ball(radius: float, at: tuple[float, float, float]) -> Any:
    mesh = trimesh.creation.icosphere(3, radius=radius)
    return to_manifold(Solid(mesh.vertices + np.asarray(at), mesh.faces))


def inner(damage: Solid, part: Solid) -> Surface:
    """The faces of a damage volume that do not lie on the box."""
    low, high = part.bounds
    corners = damage.triangles
    on_skin = (np.isclose(corners, low).all(1) | np.isclose(corners, high).all(1)).any(1)
    return Surface(damage.vertices, damage.faces[~on_skin][:, ::-1])


def make(units: str = "mm", size: float = 1.0) -> Result:
    """A box of 40 x 30 x 20 times ``size``, two bites off its top; site 2 has a deposit larger than its damage."""
    mesh = trimesh.creation.box((40, 30, 20))
    part = Part(mesh.vertices * size, mesh.faces, unit=units)
    whole = to_manifold(part)
    lost = [(whole ^ ball(radius, at).scale((size,) * 3)) for radius, at in ((6, (-8, 1, 13)), (4, (11, -5, 11)))]
    damages = [to_solid(body) for body in lost]
    deposits = (None, to_solid(ball(4, (11, -5, 11)).scale((size,) * 3)))
    sites = tuple(
        Site(k, (k,), np.arange(5), damage, inner(damage, part), deposit, "implicit", Evidence(), 2.0)
        for k, damage, deposit in zip((1, 2), damages, deposits, strict=True)
        if damage is not None
    )
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", (20, -50, 130), degrees=True).as_matrix()
    T[:3, 3] = np.array([300.0, -20, 75]) * size
    pose = Pose(T)
    points = np.random.default_rng(1).normal(size=(50, 3)) * size
    scan = Scan(points, unit=units)
    deviation = Deviation(np.zeros(50), np.zeros(50, int), np.zeros(50, np.uint8))
    damage = to_solid(unite(s.damage for s in sites))
    undamaged = to_solid(subtract_lost(whole, lost[0] + lost[1]))
    label = np.zeros(50, np.int32)
    return Result(
        "two", units, 0.1 * size, part, scan, scan.move(T), pose, deviation, label, sites, damage, undamaged,
        (), (), None,
    )  # fmt: skip


def without_damage() -> Result:
    plain = make()
    return replace(plain, sites=(), damage=None, undamaged=plain.part)
