"""Distance of each scan point to the CAD points, as in the paper (3.1 step 4, 3.2)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Floats, Ints, Samples, Scan
from damageest.errors import StageError
from damageest.stages.segment import Segment

NEAREST = 12
"""CAD points looked at for each scan point: those round it on a face, and some of the next face at an edge."""
PLAIN_SPACING, TANGENT_SPACING = 0.5, 2.0
"""Most of the CAD points' spacing, in thresholds. At the paper's bound of 1 the gap alone may use up all of a plain
distance's threshold; discs cover the gaps on faces, and miss what is as shallow as the threshold only beside edges."""


class CloudDistance(Segment):
    """Distance to the CAD points instead of the triangles (the paper's one-sided Hausdorff distance), signed by their
    normals."""

    use: Literal["cloud_distance"] = "cloud_distance"
    threshold: float = Field(
        1.0, gt=0, description="distance from the part beyond which a point is damage or added metal, in tolerances"
    )
    measure: Literal["tangent", "plain"] = Field(
        "tangent",
        description="tangent: to flat discs round the CAD points, as wide as their spacing; plain: to the points "
        "themselves, which needs them at half the threshold (sample: {use: edge_aware, spacing: 0.5})",
    )

    def run(self, aligned: Scan, samples: Samples, tolerance: float) -> Deviation:
        """Distance (N,), positive outside, in the job's unit; triangle (N,) of the CAD point it is to; label (N,).

        With s the spacing of the CAD points and d the true distance: 'plain' gives up to sqrt(d^2 + s^2), too much;
        'tangent' is right on flat faces, off by up to s^2 / 2R where the radius of curvature is R, and too small
        beside an edge, on its outer side if convex and its inner side if concave, but never below
        sqrt(p^2 - s^2) for a plain distance of p.
        Raises StageError where the CAD points lie too far apart for the threshold.
        """
        limit = self.threshold * tolerance
        widest = (TANGENT_SPACING if self.measure == "tangent" else PLAIN_SPACING) * limit
        if samples.spacing > widest * (1 + 1e-9):
            raise StageError(
                f"the CAD points are {samples.spacing:.4g} apart, too coarse for a threshold of {limit:.4g} by the "
                f"{self.measure} distance, which takes {widest:.4g} at most",
                "sample.spacing smaller (or sample.max_points larger), segment.measure: tangent, or segment: "
                "mesh_distance",
            )
        distance, face = cloud_distance(aligned.points, samples, self.measure == "plain")
        label = np.full(len(distance), INTACT, np.uint8)
        label[distance < -limit] = DAMAGE
        label[distance > limit] = ADDED
        return Deviation(distance=distance, face=face, label=label)


def cloud_distance(points: Floats, samples: Samples, plain: bool = False) -> tuple[Floats, Ints]:
    """Signed distance (N,) of ``points`` (N,3) to CAD points, and the triangle (N,) of the one that it is to."""
    from scipy.spatial import cKDTree

    if not len(points):
        return np.empty(0), np.empty(0, np.int64)
    # Those on edges have normals of neither face; the faces' own points tell sides apart.
    flat = np.flatnonzero(samples.kind == 0)
    flat = flat if len(flat) else np.arange(len(samples.points))
    tree = cKDTree(samples.points[flat])
    count = min(NEAREST, len(flat))
    distance, face = np.empty(len(points)), np.empty(len(points), np.int64)
    for start in range(0, len(points), 200_000):  # so that the neighbours of a scan of millions fit in memory
        part = slice(start, start + 200_000)
        far, index = (np.reshape(a, (-1, count)) for a in tree.query(points[part], k=count, workers=2))
        distance[part], face[part] = _sign_distance(points[part], samples, far, flat[index], plain)
    if len(flat) < len(samples.points):
        # An edge's own points bound the distance from above.
        edge, _ = cKDTree(samples.points[samples.kind > 0]).query(points, workers=2)
        distance = np.sign(distance) * np.minimum(np.abs(distance), edge)
    return distance, face


def _sign_distance(points: Floats, samples: Samples, far: Floats, index: Ints, plain: bool) -> tuple[Floats, Ints]:
    """As `cloud_distance`, from the distances ``far`` and indices (N,K) of the nearest CAD points, nearest first."""
    height = np.einsum("ikj,ikj->ik", points[:, None] - samples.points[index], samples.normals[index])
    # The foot on the true surface has a CAD point within the spacing: one of these, for a face that is flat.
    may = far**2 <= far[:, :1] ** 2 + samples.spacing**2
    rows = np.arange(len(points))
    # Beside an edge several faces are about as near; the one seen most squarely has the side right.
    square = np.where(may, np.abs(height) / np.maximum(far, 1e-300), -1).argmax(axis=1)
    sign = np.where(height[rows, square] < 0, -1.0, 1.0)
    if plain:
        return sign * far[:, 0], samples.face[index[:, 0]]
    lateral = np.sqrt(np.maximum(far**2 - height**2, 0))
    # Seen from afar, the disc of a face nearly edge on reaches out beyond its edge; close by, no face is seen squarely.
    cosine = np.abs(height) / np.maximum(far, 1e-300)
    may &= (cosine >= 0.7 * cosine[rows, square][:, None]) | (far[:, :1] < 1.2 * samples.spacing)
    disc = np.where(may, np.hypot(height, np.maximum(lateral - samples.spacing, 0)), np.inf)
    best = disc.argmin(axis=1)
    least = np.sqrt(np.maximum(far[:, 0] ** 2 - samples.spacing**2, 0))
    return sign * np.clip(disc[rows, best], least, far[:, 0]), samples.face[index[rows, best]]
