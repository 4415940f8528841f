"""Shallow damage enclosed by a sweep: its surface is moved out of the part."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.distance import is_inside
from damageest.geometry.vectors import normalise
from damageest.stages.enclose import Enclose

REMEDY = "enclose: divide"
MOST_FLAWED = 0.02
"""Share, of area or of points, up to which a check may fail: so much is a flaw of the scan, not the damage's shape."""


class Sweep(Enclose):
    """Sweeps the damage surface along its mean normal until it is outside the part. Fast.

    For wear and shallow dents. Undercuts, steep walls, deep pits and damage with several rims are refused.
    """

    refines: ClassVar[bool] = True  # A sweep uses no background, so a coarse one is enough.

    use: Literal["sweep"] = "sweep"
    overhang: float = Field(3.0, ge=0, le=20, description="extension of the surface beyond its rim, in tolerances")
    steepest: float = Field(
        80.0, gt=0, lt=90, description="largest angle between the normal of the surface and the sweep, in degrees"
    )

    def run(self, surface: Surface, rims: Rims, part: Part, intact: Floats, points: Floats, tolerance: float) -> Mesh:
        """Raises StageError where a sweep cannot represent the damage; the remedy names a stage that can."""
        from damageest_sweep._rim import extend_rim, fill_gaps, measure_overlap

        if len(rims.loops) != 1:
            raise StageError(
                f"the damage surface has {len(rims.loops)} rims; a sweep can close only one", REMEDY, method="implicit"
            )
        faces, rim, direction = orient_to_skin(surface, rims.loops[0], part)
        wide = fill_gaps(Mesh(surface.vertices, faces), rim)
        if (share := measure_steep_share(wide, direction, self.steepest)) > MOST_FLAWED:
            raise StageError(
                f"{share:.0%} of the damage surface is steeper than {self.steepest:g} degrees to the sweep",
                REMEDY,
                method="implicit",
            )
        wide, rim = extend_rim(wide, rim, direction, self.overhang * tolerance, self.steepest)
        if (
            share := max(measure_steep_share(wide, direction, 90), measure_overlap(wide.vertices[rim], direction))
        ) > MOST_FLAWED:
            raise StageError(
                f"{share:.0%} of the damage surface overlaps itself along the sweep", REMEDY, method="implicit"
            )
        mesh = sweep_surface(wide, rim, direction * find_clear_distance(wide.vertices, direction, part, 2 * tolerance))
        if loose := open_edges(mesh.faces):
            raise StageError(
                f"the sweep is not watertight: {loose} of its edges are open, because the damage surface is torn",
                REMEDY,
                method="implicit",
            )
        beside = np.concatenate([surface.vertices, mesh.vertices[rim]])
        if (count := count_points_inside(mesh, intact, beside, (self.overhang + 1) * tolerance)) > MOST_FLAWED * len(
            points
        ):
            raise StageError(f"{count} intact scan points lie inside the sweep", REMEDY, method="implicit")
        return mesh


def orient_to_skin(surface: Surface, rim: Ints, part: Part) -> tuple[Ints, Ints, Floats]:
    """Faces (F,3) and rim (N,), both oriented so that the normals point to the nearest skin; and their mean (3,) as a
    unit vector.

    Raises StageError where the normals cancel out.
    """
    from damageest.geometry.distance import signed_distance

    _, nearest = signed_distance(surface.triangles.mean(axis=1), part)
    outward = normalise(part.cross[nearest])
    sign = 1 if np.einsum("ij,ij->", surface.cross, outward) > 0 else -1
    mean = sign * surface.cross.sum(axis=0)
    if not np.linalg.norm(mean) > 0.1 * 2 * surface.area:
        raise StageError(
            "the normals of the damage surface cancel out, so there is no direction to sweep along",
            REMEDY,
            method="implicit",
        )
    return surface.faces[:, ::sign], rim[::sign], mean / np.linalg.norm(mean)


def measure_steep_share(mesh: Mesh, direction: Floats, limit: float) -> float:
    """Share of a mesh's area whose normals are more than ``limit`` degrees from ``direction`` (3,)."""
    size = 2 * mesh.face_areas
    return float(size[mesh.cross @ direction < np.cos(np.deg2rad(limit)) * size].sum() / size.sum())


def find_clear_distance(vertices: Floats, direction: Floats, part: Part, margin: float) -> float:
    """How far ``vertices`` (V,3) must move along ``direction`` (3,) until all are outside the part, at least half of
    ``margin`` from it.

    Raises StageError where they enter the part again.
    """
    from damageest.geometry.distance import signed_distance

    far = margin
    while far < part.diagonal:
        # The deepest vertex must move by at least its depth.
        lowest = float(signed_distance(vertices + far * direction, part)[0].min())
        if lowest > margin / 2:
            return far
        far += margin - lowest
    raise StageError("the swept surface does not leave the part", REMEDY, method="implicit")


def sweep_surface(mesh: Mesh, rim: Ints, move: Floats) -> Mesh:
    """The closed mesh between an open mesh and its copy, moved by ``move`` (3,) to the side of its normals."""
    count = len(mesh.vertices)
    after = np.roll(rim, -1)
    walls = [np.stack([rim, after, after + count], axis=1), np.stack([rim, after + count, rim + count], axis=1)]
    faces = np.concatenate([mesh.faces[:, ::-1], mesh.faces + count, *walls])
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices + move]), faces)


def count_points_inside(mesh: Mesh, intact: Floats, beside: Floats, reach: float) -> int:
    """How many of the intact points (K,3) lie inside a closed mesh, without those within ``reach`` of ``beside`` (M,3).

    Pass the surface and its rim as ``beside``: near them, noise decides whether a point counts as intact.
    """
    from scipy.spatial import cKDTree

    low, high = mesh.bounds
    near = intact[((intact > low) & (intact < high)).all(axis=1)]
    if not len(near):
        return 0
    near = near[cKDTree(beside).query(near, distance_upper_bound=reach, workers=2)[0] > reach]
    return int(is_inside(near, mesh).sum())
