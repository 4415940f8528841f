"""What the beads of a path fill with the widths and heights that their settings make, by the job's trials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import DepositPath
from damageest_paths.beads import SHARE, Beads, simulate_beads
from damageest_paths.drafts import Draft

ALIKE = 1e-3
"""Share of its width or height by which a bead may differ from the planned one and be simulated as that."""


def simulate_laid(path: DepositPath, draft: Draft) -> DepositPath:
    """The path with the fill of its beads as they are laid, if it was simulated and these are not as planned.

    Each bead stands where the planned one does: a higher one ends above its layer. That the beads on it then lie higher
    too is not considered.
    """
    if path.bead_sizes is None or draft.fill is None:
        return path
    own = np.flatnonzero(path.on)
    sizes, planned = path.bead_sizes[own], path.planned_sizes[own]
    if np.allclose(sizes, planned, rtol=ALIKE, atol=0.0):
        return path
    task, above = draft.task, (sizes - planned)[:, 1:] * path.normals[own]
    beads = Beads(path.points[own - 1] + above, path.points[own] + above, path.normals[own], *sizes.T)
    edge = float(min(sizes.min(), planned.min())) / SHARE
    return replace(path, fill=simulate_beads(beads, task.body, draft.missing, task.left, draft.plans[0].frame, edge))
