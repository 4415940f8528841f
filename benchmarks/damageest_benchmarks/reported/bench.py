"""What each report is made from: a part with a loss, points on what is left, and a random pose."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Scan, Solid
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.io.meshes import write_ply, write_points
from damageest.io.scans import read_scan
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out
from damageest_benchmarks.troubles.parts import make_named_part
from damageest_benchmarks.troubles.views import place_scanners, scan_surface

POINTS = 20_000
NOISE = 0.0004
"""As a share of the diagonal; the tolerance is four of them."""

Moved = Callable[[Floats], Floats]
"""What a file or a filter does with points (N,3), in the scanner's frame."""


@dataclass(frozen=True, eq=False)
class Bench:
    """A part, what is left of it after ``damage``, and random draws."""

    part: Part
    left: Mesh
    damage: Solid | None
    seed: int
    rng: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "rng", np.random.default_rng([7101, self.seed]))

    @property
    def noise(self) -> float:
        return NOISE * self.part.diagonal

    @property
    def tolerance(self) -> float:
        return 4 * self.noise

    def scan(self, count: int = POINTS, mesh: Mesh | None = None, noise: float = 1.0) -> tuple[Floats, Floats]:
        """Points (count,3) on all skin of what is left, or of ``mesh``, and the outward normals (count,3) there."""
        mesh = mesh or self.left
        points, face = sample_by_area(mesh, count, self.rng)
        return self.blur(points, noise), mesh.face_normals[face]

    def look(self, views: int, count: int = POINTS, scanners: Floats | None = None) -> tuple[Floats, Any, Floats]:
        """Points (count,3) that are seen from scanner positions, the view (count,) of each, and the positions (V,3)."""
        scanners = place_scanners(self.part, views, self.rng) if scanners is None else scanners
        points, view = scan_surface(self.left, scanners, count, self.rng)
        return self.blur(points), view, scanners

    def blur(self, points: Floats, noise: float = 1.0) -> Floats:
        """Points with the scanner's noise, or so many times it."""
        return points + self.rng.normal(scale=noise * self.noise, size=points.shape)

    def finish(
        self, points: Floats, normals: Floats | None = None, *, after: Moved | None = None, rigid: bool = True
    ) -> Draw:
        """A scan of these points in a random pose; ``after`` changes them in the scanner's frame. ``rigid``: whether
        one pose is right for all of them."""
        scan, pose = move_out(Scan(points, normals, unit="mm"), draw_motion(self.rng, self.part.diagonal))
        if after is not None:
            scan = replace(scan, points=after(scan.points))
        return Draw(self.part, scan, self.damage, pose, self.tolerance, rigid=rigid)

    def finish_mesh(self, mesh: Mesh, after: Moved | None = None) -> Draw:
        """A scan that a program saved as a mesh."""
        draw = self.finish(mesh.vertices, after=after)
        with tempfile.TemporaryDirectory(prefix="damageest-reported-") as folder:
            path = Path(folder) / "scan.ply"
            write_ply(path, Mesh(draw.scan.points, mesh.faces))
            return replace(draw, scan=read_scan([path], "mm"))


def read_again(draw: Draw, columns: dict[str, Floats] | None = None) -> Draw:
    """The draw with its scan as a file of the points, and of more columns (N,), is read."""
    with tempfile.TemporaryDirectory(prefix="damageest-reported-") as folder:
        path = Path(folder) / "scan.ply"
        write_points(path, dict(zip("xyz", draw.scan.points.T, strict=True)) | (columns or {}))
        return replace(draw, scan=read_scan([path], "mm"))


def take(name: str, seed: int, toward: Sequence[float] = (), radius: float = 0.09) -> Bench:
    """A part that lost a ball of ``radius`` diagonals round its corner that is farthest ``toward`` a direction; without
    one, the seed tells which of the eight."""
    toward = toward or [1.0 if seed >> bit & 1 else -1.0 for bit in range(3)]
    part = make_named_part(name, 0.0)
    corner = part.vertices[np.argmax(part.vertices @ np.asarray(toward, dtype=np.float64))]
    return bite(part, seed, corner, radius * part.diagonal)


def bite(part: Part, seed: int, centre: Sequence[float] | Floats, radius: float) -> Bench:
    """A part that lost a ball."""
    from manifold3d import Manifold

    return cut(part, seed, Manifold.sphere(radius, 64).translate(tuple(float(value) for value in centre)))


def cut(part: Part, seed: int, tool: Any) -> Bench:
    """A part that lost what a Manifold holds."""
    body = to_manifold(part)
    return Bench(part, Mesh(*to_arrays(body - tool)), to_solid(body ^ tool), seed)


def refine(mesh: Mesh, length: float) -> Mesh:
    """The same surface with edges no longer than ``length``, as a scanner's program makes it."""
    return Mesh(*to_arrays(to_manifold(mesh).refine_to_length(length)))
