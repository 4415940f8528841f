"""Distance of each scan point to the samples of the part, as in the paper (3.1 step 4, 3.2)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Floats, Ints, Samples, Scan
from damageest.errors import StageError
from damageest.geometry.threads import count_threads
from damageest.stages.segment import Segment

NEAREST = 12
"""Number of nearest samples used for each scan point: those around it on a face, and some of the next face at an
edge."""
PLAIN_SPACING, TANGENT_SPACING = 0.5, 2.0
"""Largest spacing of the samples, in thresholds. At the paper's bound of 1, the gap between samples alone may be as
large as the threshold of a plain distance. Discs cover the gaps on faces; damage as shallow as the threshold is then
missed beside edges only."""


class CloudDistance(Segment):
    """Distance to samples of the part instead of triangles, signed by their normals.

    This is the one-sided Hausdorff distance of the paper.
    """

    use: Literal["cloud_distance"] = "cloud_distance"
    threshold: float = Field(
        1.0, gt=0, description="distance from the part beyond which a point is damage or added metal, in tolerances"
    )
    measure: Literal["tangent", "plain"] = Field(
        "tangent",
        description="tangent: distance to flat discs around the samples, with their spacing as radius; plain: distance "
        "to the samples, which must be at most half a threshold apart (sample: {use: edge_aware, spacing: 0.5})",
    )

    def run(self, aligned: Scan, samples: Samples, tolerance: float) -> Deviation:
        """Distance (N,), positive outside, in the job's unit; triangle (N,) of the nearest sample; label (N,).

        With s the spacing of the samples and d the true distance: 'plain' gives up to sqrt(d^2 + s^2), which is too
        large. 'tangent' is exact on flat faces and has an error of up to s^2 / 2R where the radius of curvature is R.
        Beside an edge it is too small, outside a convex one and inside a concave one, but never below
        sqrt(p^2 - s^2) where the plain distance is p.
        Raises StageError where the samples are too far apart for the threshold.
        """
        limit = self.threshold * tolerance
        widest = (TANGENT_SPACING if self.measure == "tangent" else PLAIN_SPACING) * limit
        if samples.spacing > widest * (1 + 1e-9):
            raise StageError(
                f"the samples of the part are {samples.spacing:.4g} apart, too coarse for a threshold of {limit:.4g}: "
                f"the {self.measure} distance needs {widest:.4g} at most",
                "use a smaller sample.spacing (or a larger sample.max_points), segment.measure: tangent, or segment: "
                "mesh_distance",
            )
        distance, face = cloud_distance(aligned.points, samples, self.measure == "plain")
        label = np.full(len(distance), INTACT, np.uint8)
        label[distance < -limit] = DAMAGE
        label[distance > limit] = ADDED
        return Deviation(distance=distance, face=face, label=label)


def cloud_distance(points: Floats, samples: Samples, plain: bool = False) -> tuple[Floats, Ints]:
    """Signed distance (N,) of ``points`` (N,3) to samples of the part, and the triangle (N,) of the nearest one.

    ``plain``: to the samples themselves; else to flat discs around them.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.empty(0), np.empty(0, np.int64)
    # Samples on edges have normals of neither face; only samples on faces give the sign.
    flat = np.flatnonzero(samples.kind == 0)
    flat = flat if len(flat) else np.arange(len(samples.points))
    tree = cKDTree(samples.points[flat])
    count = min(NEAREST, len(flat))
    distance, face = np.empty(len(points)), np.empty(len(points), np.int64)
    for start in range(0, len(points), 200_000):  # so that the neighbours of a scan of millions fit in memory
        part = slice(start, start + 200_000)
        far, index = (np.reshape(a, (-1, count)) for a in tree.query(points[part], k=count, workers=count_threads()))
        distance[part], face[part] = _sign_distance(points[part], samples, far, flat[index], plain)
    if len(flat) < len(samples.points):
        # The distance to a sample on an edge is an upper bound.
        edge, _ = cKDTree(samples.points[samples.kind > 0]).query(points, workers=count_threads())
        distance = np.sign(distance) * np.minimum(np.abs(distance), edge)
    return distance, face


def _sign_distance(points: Floats, samples: Samples, far: Floats, index: Ints, plain: bool) -> tuple[Floats, Ints]:
    """As `cloud_distance`, from the distances ``far`` and indices (N,K) of the nearest samples, nearest first."""
    height = np.einsum("ikj,ikj->ik", points[:, None] - samples.points[index], samples.normals[index])
    # The closest point of a flat face has a sample within the spacing: one of these.
    candidate = far**2 <= far[:, :1] ** 2 + samples.spacing**2
    rows = np.arange(len(points))
    # Beside an edge several faces are about equally near; the one with the most perpendicular view gives the right
    # sign.
    square = np.where(candidate, np.abs(height) / np.maximum(far, 1e-300), -1).argmax(axis=1)
    sign = np.where(height[rows, square] < 0, -1.0, 1.0)
    if plain:
        return sign * far[:, 0], samples.face[index[:, 0]]
    lateral = np.sqrt(np.maximum(far**2 - height**2, 0))
    # From far away, the disc of a face seen at a flat angle extends beyond its edge; close by, no view is
    # perpendicular.
    cosine = np.abs(height) / np.maximum(far, 1e-300)
    candidate &= (cosine >= 0.7 * cosine[rows, square][:, None]) | (far[:, :1] < 1.2 * samples.spacing)
    disc = np.where(candidate, np.hypot(height, np.maximum(lateral - samples.spacing, 0)), np.inf)
    best = disc.argmin(axis=1)
    least = np.sqrt(np.maximum(far[:, 0] ** 2 - samples.spacing**2, 0))
    return sign * np.clip(disc[rows, best], least, far[:, 0]), samples.face[index[rows, best]]
