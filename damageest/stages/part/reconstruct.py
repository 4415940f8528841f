"""Makes the part from the scan of an undamaged specimen, where there is no CAD model (paper 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Mesh, Part
from damageest.errors import InputError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.threads import count_threads
from damageest.geometry.units import UnitOption
from damageest.io.files import files_sha256
from damageest.io.scans import read_scan
from damageest.stages import JobPath
from damageest.stages.part import ReadPart

MIN_POINTS = 1000
HOLD_OUT = 20
VOXEL_FACTORS = (1.0, 1.6, 2.5)
"""Sizes of the voxels that separate inside from outside, tried in this order until the shell has no openings."""
NOTED_GAP, MAX_GAP = 2.0, 3.5
"""Gaps, in radii of circles with seven neighbours, from which on a note mentions them, and that are refused."""


class PartFromScan(ReadPart):
    """Makes a closed part from the scan of an undamaged specimen, in that scan's frame, by screened Poisson.

    Only for parts without a CAD model: the surface has the noise of the scan, and sharp edges are rounded.
    """

    renamed: ClassVar[Mapping[str, str]] = {"screening": "point_weight"}
    use: Literal["reconstruct"] = "reconstruct"
    path: JobPath | tuple[JobPath, ...] = Field(
        description="the specimen's scan, a file or a list of files in one frame, relative to the job's folder"
    )
    unit: UnitOption | None = Field(
        None, description="unit of the files' lengths; default: the file's own (E57: m), else the job's `units`"
    )
    cell: float | None = Field(
        None, gt=0, description="resolution, in the job's unit; default: from the spacing and noise of the scan"
    )
    point_weight: float = Field(4.0, gt=0, le=100, description="weight of the points against smoothness of the surface")
    most_cells: int = Field(
        16_000_000,
        ge=100_000,
        le=100_000_000,
        description="largest number of grid cells; a default resolution is made coarser to meet it",
    )

    def run(self, unit: str) -> Part:
        """The part in ``unit``. ``tessellation_error`` is the 95th percentile of the distances of held-out points,
        every 20th, to the surface, noise included. Raises InputError for a scan whose points do not close a surface."""
        from damageest.geometry.noise import measure_noise_and_spacing

        paths = (self.path,) if isinstance(self.path, Path) else self.path
        scan = read_scan(paths, unit, self.unit)
        if len(scan.points) < MIN_POINTS:
            raise InputError(
                f"part: {len(scan.points)} points are too few for a part; at least {MIN_POINTS} are needed"
            )
        noise, spacing = measure_noise_and_spacing(scan.points)
        try:
            vertices, faces, cell, error = self._build_surface(scan.points, noise, spacing)
            openings = _note_openings(vertices, faces, scan.points)
        except InputError as fault:
            raise InputError(f"{', '.join(map(str, paths))}: {fault}") from None
        digest = files_sha256(paths)
        note = (
            f"reconstructed from {len(scan.points)} scan points, in the scan's frame: error up to {error:.3g} for 95 "
            f"% of held-out points (noise {noise:.3g} included), edges rounded by about {cell:.3g}"
        )
        return Part(
            vertices, faces, unit, ", ".join(map(str, paths)), digest, tessellation_error=error,
            notes=(*scan.notes, *map(str, scan.warnings), note, *openings),
        )  # fmt: skip

    def _build_surface(self, points: Floats, noise: float, spacing: float) -> tuple[Floats, Ints, float, float]:
        """Vertices, faces, resolution and error of the closed surface through ``points`` (N,3)."""
        from damageest.geometry.isosurface import extract_region
        from damageest.geometry.local_fits import smooth_points
        from damageest.geometry.neighbourhoods import measure_local_areas, thin_points
        from damageest.geometry.poisson import make_grid, solve_coarse_to_fine

        held_out = np.arange(len(points)) % HOLD_OUT == 0
        span = np.ptp(points, axis=0)
        least = float(np.prod(span * 1.1) / self.most_cells) ** (1 / 3)
        cell = self.cell or max(spacing, 2 * noise, least)
        if float(np.prod(span / cell + 16)) > 1.5 * self.most_cells:
            raise InputError(
                f"a resolution of {cell:.3g} needs more than most_cells ({self.most_cells}); set part.cell larger"
            )
        cloud, *_ = thin_points(points[~held_out], 0.8 * cell)
        cloud, normals, _ = smooth_points(cloud, noise, 24)
        normals = _turn_outward(cloud, normals, 1.25 * max(cell, spacing))
        grid = make_grid(points.min(axis=0) - 8 * cell, points.max(axis=0) + 8 * cell, cell)
        # The level is positive inside, hence normals inward.
        field = solve_coarse_to_fine(grid, cloud, -normals, measure_local_areas(cloud), self.point_weight)
        region = extract_region(grid, field)
        if region is None:
            raise InputError("no closed surface could be reconstructed; scan the specimen from all sides")
        error = _measure_error(region.vertices, region.faces, points[held_out], cell, noise)
        return region.vertices, region.faces, cell, error


def _turn_outward(cloud: Floats, normals: Floats, voxel: float) -> Floats:
    """The normals, turned outward with the finest voxels whose shell has no openings."""
    from damageest.stages.part._turn_outward import turn_outward

    first: InputError | None = None
    for factor in VOXEL_FACTORS:
        try:
            return turn_outward(cloud, normals, factor * voxel)
        except InputError as fault:
            first = first or fault
    assert first is not None
    raise first


def _measure_error(vertices: Floats, faces: Ints, held_out: Floats, cell: float, noise: float) -> float:
    """The 95th percentile of the distances of points (H,3) to the surface. Raises InputError where it is too large."""
    error = float(np.percentile(distance_to_mesh(held_out, Mesh(vertices, faces)), 95))
    if error > 3 * noise + cell:
        raise InputError(f"the surface deviates from its points by {error:.3g}; set part.cell smaller than {cell:.3g}")
    return error


def _note_openings(vertices: Floats, faces: Ints, points: Floats) -> tuple[str, ...]:
    """A note on gaps between the points (N,3) that the surface closes; empty where there are none.

    A gap is compared with the circle that holds the seven neighbours of the nearest point, so that uneven density is no
    gap: among random points, one place in a million is farther than two radii from all of them. Raises InputError for
    gaps that are too wide.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    middle = vertices[faces].mean(axis=1)
    far, nearest = (np.asarray(found) for found in tree.query(middle, workers=count_threads()))
    near, at = np.unique(nearest, return_inverse=True)
    gap = far / np.asarray(tree.query(points[near], 8, workers=count_threads())[0])[at, -1]
    place, size = middle[gap.argmax()], 2 * float(far[gap.argmax()])
    text = f"of about {size:.2g} across at ({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g})"
    if gap.max() > MAX_GAP:
        share = 100 * float((gap > NOTED_GAP).mean())
        raise InputError(
            f"the specimen's scan has an opening {text}, {share:.1f} % of the surface would have no points; "
            "scan the specimen there too"
        )
    return (f"the surface closes openings of the specimen's scan, the widest {text}",) if gap.max() > NOTED_GAP else ()
