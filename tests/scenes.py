"""Damaged parts with known truth, scanned with noise at known pose, for the tests of the stages after alignment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from manifold3d import Manifold

from damageest.artefacts import Deviation, Floats, Mesh, Part, Samples, Scan, Sites, Solid
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import to_arrays
from damageest.pipeline.near_damage import sample_near_damage
from damageest.stages.cluster.dbscan import Dbscan
from damageest.stages.enclose.implicit import Implicit
from damageest.stages.segment.mesh_distance import MeshDistance

NOISE = 0.02
TOLERANCE = 0.08


@dataclass(frozen=True, eq=False)
class Scene:
    """All inputs of an enclosure, and ``truth``, the damage."""

    part: Part
    truth: Solid
    aligned: Scan
    deviation: Deviation
    sites: Sites
    tolerance: float = TOLERANCE

    def inputs(self) -> dict[str, Any]:
        names = ("part", "aligned", "deviation", "sites", "tolerance")
        return {name: getattr(self, name) for name in names}

    @property
    def field(self) -> ScanField:
        return ScanField(self.part, self.aligned, self.deviation, self.tolerance)

    @cached_property
    def nearby(self) -> Samples:
        """Points on the skin near the damage."""
        return sample_near_damage(self.field, self.sites, Implicit())

    def of_sites(self) -> Floats:
        return self.aligned.points[self.sites.label > 0]

    def without(self, hidden: np.ndarray[Any, Any]) -> Scene:
        """The same scene without the points that are ``hidden`` (N,)."""
        return _seen(self.part, self.truth, self.aligned.points[~hidden], self.aligned.spacing)


def block() -> Any:
    return Manifold.cube((30, 20, 12)) - Manifold.cylinder(30, 2.5, 2.5, 96, True).translate((22, 10, 0))


def plate() -> Any:
    return Manifold.cube((30, 20, 0.8)) + Manifold.cube((30, 0.8, 6))


def rough_box() -> Any:
    """A box whose faces have waves of a third of the tolerance, ten tolerances long."""

    def displace(points: Floats) -> Floats:
        wave = np.sin(2 * np.pi / (10 * TOLERANCE) * points)
        return points + 0.33 * TOLERANCE * wave[:, [1, 2, 0]] * wave[:, [2, 0, 1]]

    return Manifold.cube((3, 3, 2), True).refine_to_length(0.1).warp_batch(displace)


TOOLS: dict[str, tuple[Any, Any]] = {
    "pit": (block, lambda: Manifold.sphere(4, 128).translate((9, 9, 14))),
    "edge": (block, lambda: Manifold.cube((8, 8, 8), True).rotate((35, 20, 10)).translate((1, 4, 12))),
    "deep hole": (block, lambda: Manifold.cylinder(9, 1.2, 1.2, 96).translate((10, 10, 4))),
    "end": (block, lambda: Manifold.cube((40, 60, 60), True).rotate((0, 12, 7)).translate((38, 10, 6))),
    "beside the bore": (block, lambda: Manifold.sphere(3, 128).translate((18.5, 9, 12.5))),
    "worn through": (plate, lambda: Manifold.sphere(4, 128).translate((12, 11, 2.5))),
    "rough": (lambda: Manifold.cube((6, 6, 3)), lambda: rough_box().translate((3, 3, 3))),
    "two": (
        block,
        lambda: Manifold.sphere(2, 96).translate((5, 5, 12.5)) + Manifold.sphere(2, 96).translate((12, 15, 12.5)),
    ),
}
DENSITY = {"rough": 1400}
"""Points per square millimetre where they are not 12."""


@lru_cache
def scene(name: str) -> Scene:
    """One of TOOLS, scanned with `DENSITY` points per square millimetre, or 12."""
    make, tool = TOOLS[name]
    whole = make()
    left, lost = whole - tool(), whole ^ tool()
    mesh = Mesh(*to_arrays(left))
    rng = np.random.default_rng(7)
    density = DENSITY.get(name, 12)
    points, normals = spread(mesh, int(density * mesh.area), rng)
    points = points + NOISE * rng.normal(size=len(points))[:, None] * normals
    return _seen(Part(*to_arrays(whole)), Solid(*to_arrays(lost)), points, float(0.32 * np.sqrt(12 / density)))


def spread(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Random points (N,3) on a mesh, even by area, and their normals."""
    area = np.linalg.norm(mesh.cross, axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    u, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    a, b, c = np.moveaxis(mesh.triangles[face], 1, 0)
    return a * (1 - u) + b * u * (1 - v) + c * u * v, mesh.cross[face] / area[face, None]


def _seen(part: Part, truth: Solid, points: Floats, spacing: float) -> Scene:
    aligned = Scan(points, noise=NOISE, spacing=spacing)
    deviation = MeshDistance().run(aligned=aligned, part=part, tolerance=TOLERANCE)
    sites = Dbscan().run(aligned=aligned, deviation=deviation, tolerance=TOLERANCE)
    return Scene(part, truth, aligned, deviation, sites)
