"""Whether a wide, shallow loss may lie elsewhere: in a pose a little away, other skin is worn and this is not."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.checks.interval.pose_error import make_rows
from damageest.checks.skin.coverage import SkinView
from damageest.geometry.scan_field import ScanField

DAMPING = 1e-6
"""What keeps motions still that no point tells, as a share of the largest sum of squares."""
OUTSIDE = 0.5
"""Distance outside the part, in tolerances, from which skin that a motion puts there speaks against it."""
MOST_OUTSIDE = 0.02
"""Share of the other skin that may come to lie there, by chance."""
ASKED = 5000
"""Points of a site, at most, that a motion is fitted to."""


def measure_elsewhere(field: ScanField, members: Ints, skin: SkinView, removed: Flags) -> float:
    """Share of the depth of a site's points (mean squares) that one small motion of the scan explains; 0 where that
    motion puts other skin outside the part, which no wear explains.

    Args:
        members: (M,) the site's scan points. removed: (C,) the cells of the skin that the site removes.
    """
    if not len(members):
        return 0.0
    some = members[:: max(1, len(members) // ASKED)]
    centre = field.part.bounds.mean(axis=0)
    size = field.part.diagonal / 4
    scale = np.array([1 / size] * 3 + [1.0] * 3)
    depth = -field.distance[some]
    rows = make_rows(field.points[some] - centre, field.find_normals(some)) * scale
    square = rows.T @ rows
    motion: Floats = np.linalg.solve(square + DAMPING * np.trace(square) * np.eye(6), rows.T @ depth)
    left = depth - rows @ motion
    explained = 1 - float((left**2).sum() / max((depth**2).sum(), 1e-300))
    cells = skin.cells
    other = np.flatnonzero(skin.perhaps_seen & np.isfinite(skin.distance) & ~removed)
    if not len(other):
        return explained
    before = skin.distance[other]
    after = before + (make_rows(cells.centres[other] - centre, cells.normals[other]) * scale) @ motion
    pushed = (after > OUTSIDE * field.tolerance) & (before < OUTSIDE * field.tolerance)
    area = cells.areas[other]
    return explained if float(area[pushed].sum()) <= MOST_OUTSIDE * float(area.sum()) else 0.0
