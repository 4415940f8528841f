"""Points that no scanner measured: the smooth sheets by which software closes what a scanner did not see."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours, query_at_few
from damageest.geometry.noise import measure_scatter

SMOOTHER = 0.1
"""Scatter of a patch, in the scan's noise, up to which it has none. Noise differs by three from skin to skin."""
USUAL, USUAL_SHARE = 2.0, 0.4
"""The scatter is noise where at least so large a share of the patches has the usual one, within this factor. A surface
that was computed, and has no noise anywhere, has as much scatter as it is curved."""
LEAST_SHARE = 0.01
"""Share of the patches without noise from which a scan is searched for sheets."""
MOST_SHARE = 0.5
"""Share of the points up to which those without noise are set aside: else it is the rest that is odd."""
FEWEST = 50
"""Points of a sheet."""
PATCH = 16
"""Points of a patch."""
BORDER = 15
"""Neighbour up to whose usual distance points beside a sheet are counted to it: there it goes over into the skin."""
_SAMPLES = 600


def find_filled(points: Floats, noise: float) -> Flags:
    """Which of the points (N,3) of a scan lie on a sheet without noise, while the scan has some elsewhere.

    A patch's scatter about a quadric tells (see `damageest.geometry.noise`); a patch with a tenth of the ``noise`` that
    the rest has was computed, not measured.
    """
    none = np.zeros(len(points), bool)
    if len(points) < 4 * PATCH or not noise > 0:
        return none
    rng = np.random.default_rng(0)
    places = rng.choice(len(points), min(_SAMPLES, len(points)), replace=False)
    scatter = measure_scatter(query_at_few(points, points[places], PATCH, rng)[1])
    is_usual = (scatter > noise / USUAL) & (scatter < noise * USUAL)
    if (scatter < SMOOTHER * noise).mean() < LEAST_SHARE or is_usual.mean() < USUAL_SHARE:
        return none
    index = find_neighbours(points, PATCH)[1]
    filled = np.concatenate(
        [measure_scatter(points[some]) < SMOOTHER * noise for some in np.array_split(index, len(index) // 20_000 + 1)]
    )
    filled = _drop_small(index, filled)
    if not 0 < filled.mean() <= MOST_SHARE:
        return none
    gap = np.median(np.linalg.norm(points[index[filled, BORDER]] - points[filled], axis=1))
    filled[find_nearby(points, points[filled], float(gap))] = True
    return filled


def _drop_small(index: Ints, filled: Flags) -> Flags:
    """The filled points in groups of at least `FEWEST`, linked by neighbourhood; ``index`` (N,K): neighbours."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    row = np.repeat(np.arange(len(index)), index.shape[1])
    linked = filled[row] & filled[index.ravel()]
    pairs = row[linked], index.ravel()[linked]
    label = connected_components(coo_array((np.ones(len(pairs[0]), bool), pairs), shape=(len(index),) * 2))[1]
    return np.asarray(filled & (np.bincount(label)[label] >= FEWEST))
