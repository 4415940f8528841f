"""A closed surface through a scan that may be open, and which of it the scan shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Scan
from damageest.errors import InputError
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.isosurface import extract_region
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.neighbourhoods import find_neighbours, measure_local_areas, thin_points
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.poisson import make_grid, solve_coarse_to_fine
from damageest.geometry.smooth_faces import label_smooth_faces

HOLD_OUT = 20
SCREENING = 4.0
MARGIN = 0.06
"""Metal beyond the bounds of the scan that the surface may close around, in diagonals of the scan."""
NEIGHBOURS = 8
NEAR = 1.6
"""Distance from the nearest point, in radii of the circle about it that holds seven others, from which on a place of
the surface has no points. Among random points one place in some thousand is farther off; such spots are small."""
AGREES = 0.5
"""Cosine of the angle between the surface and the points nearest to it from which on they show it."""
RIM = 4.0
"""Width of the margin beside what has no points, in spacings, that counts as unseen: the surface bends away there."""
SPOT = 12.0
"""Area in squares of the spacing up to which a spot without points is no opening."""
ANY_ANGLE = -2.0
"""Cosine below that of every angle: triangles are connected by their edges alone."""
DISAGREE = 0.05
"""Share of neighbouring points with opposite normals from which on signs mean nothing."""


@dataclass(frozen=True, eq=False)
class ScannedSurface:
    """``vertices`` (V,3) and ``faces`` (F,3) of a closed mesh; ``unseen`` (F,): without points of the scan;
    ``seen_area``: of the others; ``noise`` and ``spacing`` of the scan; ``cell``: the resolution; ``error``: how far
    held-out points are off the surface beyond their noise."""

    vertices: Floats
    faces: Ints
    unseen: Flags
    seen_area: float
    noise: float
    spacing: float
    cell: float
    error: float


def close_surface(scan: Scan, cell: float | None, most_cells: int) -> ScannedSurface:
    """The surface by screened Poisson. ``cell``: None: from spacing and noise, as far as ``most_cells`` allow.

    Raises InputError where the scan does not tell inside from outside, or the grid would be too large.
    """
    points = scan.points
    noise, spacing = measure_noise_and_spacing(points)
    held_out = np.arange(len(points)) % HOLD_OUT == 0
    span = np.ptp(points, axis=0)
    margin = MARGIN * float(np.linalg.norm(span))
    box = span + 2 * margin
    least = float(np.prod(box) / most_cells) ** (1 / 3)
    step = cell or max(spacing, 2 * noise, least)
    if float(np.prod(box / step + 16)) > 1.5 * most_cells:
        raise InputError(f"a resolution of {step:.3g} needs more than most_cells ({most_cells}); set part.cell larger")
    margin = max(margin, 8 * step)
    cloud, *_ = thin_points(points[~held_out], 0.8 * step)
    cloud, normals, _ = smooth_points(cloud, noise, 24)
    normals = _orient(scan, cloud, normals, 1.25 * max(step, spacing))
    grid = make_grid(points.min(axis=0) - margin, points.max(axis=0) + margin, step)
    # The level is positive inside, hence normals inward.
    field = solve_coarse_to_fine(grid, cloud, -normals, measure_local_areas(cloud), SCREENING)
    region = extract_region(grid, field)
    if region is None:
        raise InputError("no surface could be reconstructed from the scan")
    mesh = Mesh(region.vertices, region.faces)
    unseen = _find_unseen(mesh, cloud, normals, spacing)
    mesh, unseen = _drop_unseen_pieces(mesh, unseen)
    if unseen.all():
        raise InputError("no surface could be reconstructed along the scan's points; set part.cell smaller")
    seen = Mesh(mesh.vertices, mesh.faces[~unseen])
    far, face, _ = closest_on_mesh(points[held_out], mesh)
    off = far[~unseen[face]]
    error = float(np.percentile(off, 95)) if len(off) else 0.0
    if not len(off) or error > 3 * noise + step:
        raise InputError(f"the surface deviates from its points by {error:.3g}; set part.cell smaller than {step:.3g}")
    beyond = float(np.sqrt(max(error**2 - (2 * noise) ** 2, 0.0)))
    return ScannedSurface(mesh.vertices, mesh.faces, unseen, seen.area, noise, spacing, step, beyond)


def _orient(scan: Scan, cloud: Floats, normals: Floats, voxel: float) -> Floats:
    """Outward normals (N,3): those of the fits, with signs by the normals of the scan, or by the space around a scan
    that is closed."""
    from damageest.stages.part._turn_outward import turn_outward

    if scan.normals is None:
        try:
            return turn_outward(cloud, normals, voxel)
        except InputError as fault:
            raise InputError(
                "the scan does not tell which side of its surface is metal; give a file with normals, part.viewpoint, "
                f"a file with scanner positions, or a mesh ({fault})"
            ) from None
    index = find_neighbours(cloud, NEIGHBOURS, scan.points)[1]
    told = np.einsum("nkj,nj->n", scan.normals[index], normals)
    turned = np.where(told < 0, -1.0, 1.0)[:, None] * normals
    among = find_neighbours(cloud, NEIGHBOURS)[1][:, 1:]
    agree = np.einsum("nkj,nj->nk", turned[among], turned)
    parallel = np.abs(agree) > 0.8
    if (agree[parallel] < 0).mean() > DISAGREE:
        raise InputError(
            "the normals in the file of the scan point to both sides of one surface; write them anew, all outward, or "
            "give scanner positions or a mesh"
        )
    return np.asarray(turned)


def _find_unseen(mesh: Mesh, cloud: Floats, normals: Floats, spacing: float) -> Flags:
    """Which triangles (F,) have no points, or lie beside such."""
    middle = mesh.triangles.mean(axis=1)
    gap, nearest = (found[:, 0] for found in find_neighbours(middle, 1, cloud))
    near, at = np.unique(nearest, return_inverse=True)
    radius = find_neighbours(cloud[near], NEIGHBOURS, cloud)[0][:, -1][at]
    agree = np.einsum("ij,ij->i", mesh.face_normals, normals[nearest])
    bare = (gap > NEAR * np.minimum(radius, 3 * np.median(radius))) | ((agree < AGREES) & (gap > 0.5 * radius))
    area = mesh.face_areas
    piece = _label_pieces(mesh, bare)
    size = np.bincount(piece[bare], area[bare], minlength=len(middle)) if bare.any() else np.zeros(len(middle))
    bare &= size[np.maximum(piece, 0)] > SPOT * spacing**2
    if not bare.any():
        return np.zeros(len(middle), bool)
    return np.asarray(find_neighbours(middle, 1, middle[bare])[0][:, 0] < RIM * spacing)


def _drop_unseen_pieces(mesh: Mesh, unseen: Flags) -> tuple[Mesh, Flags]:
    """The mesh without bodies that no point shows at all, and which triangles (F,) of it are unseen."""
    piece = _label_pieces(mesh, np.ones(len(mesh.faces), bool))
    shown = np.bincount(piece, ~unseen) > 0
    kept = shown[piece]
    if not kept.any():
        return mesh, unseen
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3)), unseen[kept]


def _label_pieces(mesh: Mesh, chosen: Flags) -> Ints:
    """The number (F,) of the piece of each chosen triangle, connected by edges; -1 for the others."""
    label = np.full(len(chosen), -1, np.int64)
    label[chosen] = label_smooth_faces(mesh.faces[chosen], mesh.face_normals[chosen], ANY_ANGLE)
    return label
