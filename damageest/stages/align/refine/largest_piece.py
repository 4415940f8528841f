"""The pose in which the largest consistent share of the skin is intact, where a piece of the part is displaced."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import move_points
from damageest.stages.align.refine.robust_fit import REACH, Fit, fit
from damageest.stages.align.surface.plane_grid import PartSurface

WIDE = 1.2
"""How much wider than the noise explains the band of a fit has to be for another pose to be looked for."""

SHARE = 0.6
"""Share of the points, from one end of the part, that a pose is fitted to."""

POINTS = 6000
"""Number of points that poses are fitted to and compared with."""

MIN_GAIN = 0.02
"""By how much more likely, on average, the points have to be intact in the other pose."""


def prefer_largest_piece(target: PartSurface, points: Floats, best: Fit, noise: float) -> Fit:
    """The fit in which more of the points (N,3) are intact than in ``best``, or ``best`` itself.

    A piece displaced by a few tolerances is within the first bands of the fit. It pulls the pose to a compromise in
    which neither piece is intact, and the band remains wide. A fit to one end of the part only is free of a piece
    at the other end.
    """
    if best.band <= WIDE * REACH * max(noise, 1e-5):
        return best
    some = points[:POINTS]
    at = move_points(some, best.pose)
    fits = [best]
    for axis in range(3):
        low, high = np.quantile(at[:, axis], [1 - SHARE, SHARE])
        for chosen in (at[:, axis] <= high, at[:, axis] >= low):
            fits.append(fit(target, some[chosen], best.pose, 1.5 * best.band, noise, 40))
    band = min(one.band for one in fits)
    # Points are counted by how likely the noise puts them there: in a compromise many are within the band, but few are
    # near the surface.
    on = [
        float(np.exp(-((target.closest(move_points(some, one.pose))[0] * REACH / band) ** 2) / 2).mean())
        for one in fits
    ]
    first = int(np.argmax(on))
    if on[first] < on[0] + MIN_GAIN:
        return best
    return fit(target, points, fits[first].pose, band, noise, 30)
