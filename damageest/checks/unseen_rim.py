"""Where a damage volume ends because the scan ends there: its rim beside skin that the scan does not show."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Part, Solid
from damageest.checks.inner_surface import pair_faces
from damageest.findings import Coverage
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.skin import find_inner_faces


def measure_unseen_rim(damage: Solid, part: Part, coverage: Coverage, reach: float) -> float:
    """Share of the length of the rim within ``reach`` of an unseen region of the skin; 0 without a rim.

    The rim are the edges between the faces of the damage volume inside the part and those on the skin.
    """
    unseen = coverage.skin.triangles[coverage.region >= 0].mean(axis=1)
    start, end = _find_rim(damage, part)
    if not len(unseen) or not len(start):
        return 0.0
    length = np.linalg.norm(end - start, axis=1)
    gap = find_neighbours((start + end) / 2, 1, unseen, reach)[0].ravel()
    return float(length[np.isfinite(gap)].sum() / max(float(length.sum()), 1e-300))


def _find_rim(damage: Solid, part: Part) -> tuple[Floats, Floats]:
    """The ends (E,3) of the edges that belong to one face inside the part and one on the skin."""
    starts, ends, first, second = pair_faces(damage.faces)
    inner = find_inner_faces(damage, part)
    rim = inner[first] != inner[second]
    return damage.vertices[starts[rim]], damage.vertices[ends[rim]]
