"""Shallow damage, enclosed by sweeping its surface out of the part."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface, open_edges
from damageest.errors import StageError
from damageest.geometry.distance import is_inside
from damageest.stages.enclose import Enclose

INSTEAD = "enclose: adaptive, or method: implicit"
FLAW = 0.02
"""Share, of area or of points, up to which something is taken for a flaw of the scan and not for the damage's shape."""


class Sweep(Enclose):
    """Sweeps the damage surface along its mean normal until it is clear of the part. For wear and shallow dents:
    nothing is searched or refined, so it is fast; undercuts, deep pits and damage with several rims are refused."""

    refines: ClassVar[bool] = True  # It takes no background at all, so a coarse one will do.

    use: Literal["sweep"] = "sweep"
    overhang: float = Field(
        3.0, ge=0, le=20, description="how far the rim is carried on along the surface, in tolerances"
    )
    steepest: float = Field(
        80.0, gt=0, lt=90, description="largest angle between the surface's normal and the sweep, in degrees"
    )

    def run(self, surface: Surface, rims: Rims, part: Part, intact: Floats, points: Floats, tolerance: float) -> Mesh:
        """Raises StageError where a sweep cannot stand for the damage, and says which way can."""
        from damageest_sweep._rim import carried_on, filled, overlap

        if len(rims.loops) != 1:
            raise StageError(
                f"the damage surface meets the skin in {len(rims.loops)} rims, a sweep closes one", INSTEAD
            )
        faces, rim, way = toward_skin(surface, rims.loops[0], part)
        wide = filled(Mesh(surface.vertices, faces), rim)
        if (share := steep(wide, way, self.steepest)) > FLAW:
            raise StageError(
                f"{share:.0%} of the damage surface is steeper than {self.steepest:g} degrees to the sweep", INSTEAD
            )
        wide, rim = carried_on(wide, rim, way, self.overhang * tolerance, self.steepest)
        if (share := max(steep(wide, way, 90), overlap(wide.vertices[rim], way))) > FLAW:
            raise StageError(f"{share:.0%} of the damage surface folds over itself when it is swept", INSTEAD)
        mesh = swept(wide, rim, way * clear(wide.vertices, way, part, 2 * tolerance))
        if loose := open_edges(mesh.faces):
            raise StageError(f"the damage surface is torn: {loose} edges of the sweep stay open", INSTEAD)
        beside = np.concatenate([surface.vertices, mesh.vertices[rim]])
        if (count := held(mesh, intact, beside, (self.overhang + 1) * tolerance)) > FLAW * len(points):
            raise StageError(f"the sweep holds {count} sound points of the scan", INSTEAD)
        return mesh


def toward_skin(surface: Surface, rim: Ints, part: Part) -> tuple[Ints, Ints, Floats]:
    """Faces (F,3) and rim (N,), both turned so that the normals point to the nearest skin, beyond which a shallow loss
    lies; and the mean normal (3,), of unit length.

    Raises StageError where the normals cancel out.
    """
    from damageest.geometry.distance import signed_distance

    _, nearest = signed_distance(surface.triangles.mean(axis=1), part)
    outward = part.cross[nearest] / np.linalg.norm(part.cross[nearest], axis=1)[:, None]
    sign = 1 if np.einsum("ij,ij->", surface.cross, outward) > 0 else -1
    mean = sign * surface.cross.sum(axis=0)
    if not np.linalg.norm(mean) > 0.1 * 2 * surface.area:
        raise StageError("the damage surface faces every way, so that there is none to sweep it", INSTEAD)
    return surface.faces[:, ::sign], rim[::sign], mean / np.linalg.norm(mean)


def steep(mesh: Mesh, way: Floats, limit: float) -> float:
    """Share of a mesh's area that is turned from ``way`` (3,) by more than ``limit`` degrees."""
    size = np.linalg.norm(mesh.cross, axis=1)
    return float(size[mesh.cross @ way < np.cos(np.deg2rad(limit)) * size].sum() / size.sum())


def clear(vertices: Floats, way: Floats, part: Part, margin: float) -> float:
    """How far ``vertices`` (V,3) have to go along ``way`` (3,) until all are outside the part, by at least half of
    ``margin``.

    Raises StageError where they run into the part again.
    """
    from damageest.geometry.distance import signed_distance

    far = margin
    while far < part.diagonal:
        # Whatever is the deepest cannot be out before it has gone its depth.
        lowest = float(signed_distance(vertices + far * way, part)[0].min())
        if lowest > margin / 2:
            return far
        far += margin - lowest
    raise StageError("the sweep does not come clear of the part", INSTEAD)


def swept(mesh: Mesh, rim: Ints, by: Floats) -> Mesh:
    """The closed mesh between an open one and its copy moved ``by`` (3,), to where its normals point."""
    count = len(mesh.vertices)
    after = np.roll(rim, -1)
    walls = [np.stack([rim, after, after + count], axis=1), np.stack([rim, after + count, rim + count], axis=1)]
    faces = np.concatenate([mesh.faces[:, ::-1], mesh.faces + count, *walls])
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices + by]), faces)


def held(mesh: Mesh, intact: Floats, beside: Floats, reach: float) -> int:
    """How many of the sound points (K,3) a closed mesh holds, but for those within ``reach`` of what lies ``beside``
    (M,3) them: near the surface and its rim, noise decides whether a point counts as sound."""
    from scipy.spatial import cKDTree

    low, high = mesh.bounds
    near = intact[((intact > low) & (intact < high)).all(axis=1)]
    if not len(near):
        return 0
    near = near[cKDTree(beside).query(near, distance_upper_bound=reach, workers=2)[0] > reach]
    return int(is_inside(near, mesh).sum())
