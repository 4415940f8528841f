"""How exactly a fitted field is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.stages.adapt._choose import Trial, cut_patches
from damageest.stages.adapt._field import Body, assemble, match, weigh

MODES = 24
"""Independent errors that are kept."""
PRIOR = 0.03
"""Strain that is allowed for where no point shows the field, at least."""
ASKED = 1500
"""Places on the skin by which the largest errors are chosen."""


def find_modes(
    chosen: Trial, trials: Sequence[Trial], points: Floats, body: Body, places: Floats, tolerance: float
) -> Floats:
    """(K,V,3) independent errors of the displacement at places (V,3), each as one standard deviation.

    The posterior of a Gaussian prior on the strain, with the points' error as large as the means of patches show it;
    and the difference to the next freer field that was tried, since the truth may be as free as that.
    """
    field = chosen.field
    last = max(tolerance, 3 * body.noise)
    found = match(field, points, body)
    loose = replace(chosen.freedom, bound=max(chosen.freedom.bound, PRIOR))
    equations = assemble(field, found, body, loose, last)
    square = equations.stiffen()[:-1, :-1]
    covariance = np.linalg.inv(square) * _measure_error(found.distance, weigh(found, last, body.noise), points, body)
    root = np.linalg.cholesky((covariance + covariance.T) / 2 / len(points))
    asked = field.basis.evaluate(places[:: max(1, len(places) // ASKED)])
    columns = root.reshape(field.basis.count, 3, -1)
    spread = np.einsum("vm,mkc->vkc", asked, columns).reshape(3 * len(asked), -1)
    _, main = np.linalg.eigh(spread.T @ spread)
    largest = columns @ main[:, ::-1][:, :MODES]
    modes = np.einsum("vm,mkc->cvk", field.basis.evaluate(places), largest)
    at = [one.freedom for one in trials].index(chosen.freedom) + 1
    alike = [one for one in trials[at:] if one.freedom.stretches == chosen.freedom.stretches]
    freer = alike[0] if alike else None
    if freer is None:
        return np.asarray(modes)
    return np.concatenate([modes, (freer.field.displace(places) - field.displace(places))[None]])


def _measure_error(distance: Floats, weights: Floats, points: Floats, body: Body) -> float:
    """The variance of one point, as if the errors of points were independent: larger than that of the noise where the
    means of patches deviate by more than noise explains."""
    patch, _ = cut_patches(points, body.mesh.diagonal)
    total = np.bincount(patch, weights)
    kept = total > 5
    mean = np.bincount(patch, weights * distance)[kept] / total[kept]
    square = float(np.median(mean**2 * total[kept])) / 0.455 if kept.any() else 0.0  # the median of a chi square
    return max(square, body.noise**2)
