"""How much may be lost where no site is found: below the tolerance, and between the points."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import ADDED
from damageest.geometry.neighbourhoods import measure_local_areas
from damageest.geometry.patches import Patches
from damageest.geometry.scan_field import ScanField
from damageest.trust.interval.site_error import WIDTH

EDGE = 4.0
"""Edge of a patch, in point spacings: about sixteen points on a face."""
MOST = 200_000
"""Points that are averaged."""


def limit_shallow_loss(field: ScanField, least_width: float = 0.0) -> float:
    """The most metal that may be lost though no site is found, in the cube of the part's unit.

    What patches of the scan lie below the skin by more than noise explains, times two, since the other skin of a thin
    wall may be the nearer one, and at most the tolerance; and one loss as wide and deep as the ``least_width``.
    """
    narrow = np.pi / 4 * least_width**3
    index = np.flatnonzero(field.label != ADDED)
    index = index[:: max(1, len(index) // MOST)]
    if not len(index):
        return float(narrow)
    points, distance, aligned = field.points[index], field.distance[index], field.aligned
    area = measure_local_areas(points)
    edge = EDGE * max(aligned.spacing, 1e-6 * field.part.diagonal)
    patches = Patches.on_skin(points, field.find_normals(index), edge)
    size = np.bincount(patches.group, weights=area)
    mean = patches.mean(distance)
    noise = aligned.noise / np.sqrt(patches.count)
    depth = np.where(mean < -WIDTH * noise, np.minimum(-2 * mean, field.tolerance), 0.0)
    return float(size @ depth + WIDTH * np.linalg.norm(size * noise) + narrow)
