"""How exactly the points on an inner damage surface fix a volume and its depth.

Three causes. Noise: each point is off by its noise over the area that it stands for; averaging over neighbours moves
that error about and does not change its sum. Spacing: between the points the surface is interpolated, and beside the
rim extrapolated, over about one gap. Rim: points less deep than the tolerance may be intact skin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Solid
from damageest.geometry.edges import pair_faces
from damageest.geometry.voxels import number_cubes

GAP = 8.0
"""Area of a connected piece without scan points from which it counts, in squares of the scan's spacing, or of the
tolerance where that is larger."""
CUBE = 5.0
"""Edge in spacings of the cubes in which the area for each point is measured: about 25 points."""
FEWEST = 4
"""Points in a cube from which its own density counts; with fewer, at most that of the whole surface."""
NOISE = 1.0
"""Standard deviation of the volume by the noise, as a share of what theory gives."""
BESIDE_RIM, AT_EDGES, RIM = 0.066, 0.073, 0.13
"""Standard deviations of the volume for each unit of length of the rim and of turning of the inner surface, in areas
that a scan point stands for; and for each unit of length of the rim, in squares of the tolerance. Measured, as the next
ones, on random damages: so large that the truth lies within two of them in 95 of 100 cases. A few shapes err more."""
FLARE, ROUNDING = 0.052, 0.14
"""By how much volumes are too large for each unit of length of the rim, in areas that a scan point stands for; and too
small for each unit of turning of the inner surface, in squares of the tolerance, because its edges are rounded."""
DEPTH_GAP, DEPTH_NOISE, DEPTH_HIGH = 0.19, 0.8, 0.12
"""Standard deviations of the largest depth, in gaps between the points of the inner surface and in noises; and by how
many gaps the depth of the damage volume is too large."""


@dataclass(frozen=True)
class InnerSurface:
    """``noise``, ``spacing``, ``rim``: standard deviations of the volume; ``excess``: by how much it is too large on
    average, negative where it is too small. ``depth``: standard deviation of the largest depth, ``depth_excess``: as
    `excess`; ``gap``: edge of the square that each scan point stands for."""

    noise: float
    spacing: float
    rim: float
    excess: float
    depth: float
    depth_excess: float
    gap: float


def measure_inner_surface(
    damage: Solid, inner: Flags, points: Floats, noise: float, spacing: float, tolerance: float
) -> InnerSurface | None:
    """The error of a damage volume's inner surface; None where it has no area or no points.

    Args:
        inner: (F,) which faces of ``damage`` are on the inner surface, as `find_inner_faces` gives them.
        points: (M,3) the scan points of the site, in the part's frame. noise, spacing: of the scan.
    """
    area = damage.face_areas
    total = float(area[inner].sum())
    if not len(points) or total <= 0 or spacing <= 0:
        return None
    share, variance = _measure_shares(damage, inner, area, points, CUBE * spacing)
    rim, turning = _measure_edges(damage, inner)
    gap = float(np.sqrt(share))
    return InnerSurface(
        noise=NOISE * noise * float(np.sqrt(variance)),
        spacing=share * float(np.hypot(BESIDE_RIM * rim, AT_EDGES * turning)),
        rim=RIM * rim * tolerance**2,
        excess=FLARE * rim * share - ROUNDING * turning * tolerance**2,
        depth=float(np.hypot(DEPTH_GAP * gap, DEPTH_NOISE * noise)),
        depth_excess=DEPTH_HIGH * gap,
        gap=gap,
    )


def _measure_shares(damage: Solid, inner: Flags, area: Floats, points: Floats, edge: float) -> tuple[float, float]:
    """The area that one point of the inner surface stands for, on average; and the sum of its square over the points,
    with the density of each cube of ``edge``."""
    total = float(area[inner].sum())
    share = total / len(points)
    places = np.concatenate([damage.triangles.mean(axis=1), points])
    _, cube = np.unique(number_cubes(places, edge)[1], return_inverse=True)
    own = np.bincount(cube[: len(area)], weights=area * inner, minlength=int(cube.max()) + 1)
    count = np.bincount(cube[len(area) :], minlength=len(own))
    own_share = own / np.maximum(count, 1)
    shares = np.where(count >= FEWEST, own_share, np.maximum(own_share, share))
    return share, float((own * shares).sum())


def _measure_edges(damage: Solid, inner: Flags) -> tuple[float, float]:
    """Length of the rim; and the turning of the inner surface: the sum over its edges of length times turning angle,
    positive where the damage volume is convex. Noise turns to both sides, so that it adds nothing."""
    starts, ends, first, second = pair_faces(damage.faces)
    along = damage.vertices[ends] - damage.vertices[starts]
    length = np.linalg.norm(along, axis=1)
    rim = inner[first] != inner[second]
    within = inner[first] & inner[second]
    a, b = damage.face_normals[first[within]], damage.face_normals[second[within]]
    # the sine times the length of the edge has the sign of the turning
    sine = np.einsum("ij,ij->i", np.cross(a, b), along[within]) / np.maximum(length[within], 1e-300)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", a, b))
    return float(length[rim].sum()), float(length[within] @ angle)
