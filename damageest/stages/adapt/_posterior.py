"""How exactly a fitted field is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.duplicates import group_integers
from damageest.geometry.voxels import number_cubes
from damageest.stages.adapt._choose import Trial, cut_patches
from damageest.stages.adapt._field import Body, Match, match, weigh
from damageest.stages.adapt._fit import Equations, weigh_points, weigh_roughness, weigh_strain

MODES = 24
"""Independent errors that are kept."""
PRIOR = 0.002
"""Strain that is allowed for where no point shows the field, at least, as one standard deviation."""
BEYOND = 0.004
"""Strain of the metal beyond the skin that is seen, as one standard deviation: that of a bend about an axis which is
some way from the middle of the section."""
SMALL, FEWEST = 25.0, 4
"""Patches along the part's diagonal by which it is asked what is left, and the least weight of their points."""
RARE, WIDTH = 0.02, 2.33
"""Share of patches that are worse than the worst that count, and that of a normal distribution in its deviations."""
ASKED = 1500
"""Places on the skin by which the largest errors are chosen."""


def find_modes(
    chosen: Trial, trials: Sequence[Trial], points: Floats, body: Body, skin: Mesh, tolerance: float,
    beyond: Floats | None = None,
) -> Floats:  # fmt: skip
    """(K,V,3) independent errors of the displacement at the vertices of the skin as designed, each as one standard
    deviation.

    The posterior of a Gaussian prior on the strain, with the points' error as large as the means of patches show it;
    what the metal may be strained by beyond the skin that is seen, which grows with the distance from it; and the
    difference to the next freer field that was tried, since the truth may be as free as that. What the field leaves of
    intact skin is not among them (`measure_left`). ``beyond`` (J,V,3): what other parts of the type say about skin that
    is not seen, in place of a strain.
    """
    field, places = chosen.field, skin.vertices
    last = max(tolerance, 3 * body.noise)
    found = match(field, points, body)
    loose = replace(chosen.freedom, bound=max(chosen.freedom.bound, PRIOR))
    weights = weigh(found, last, body.noise)
    shown = weigh_points(field, found, weights)
    # the mean square of all points, as their number and their error make it, against a strain that is drawn once
    shown = Equations(shown.square + weigh_roughness(field, shown), shown.right)
    precision = len(points) / _measure_error(found.distance, weights, points, body)
    square = precision * shown.stiffen() + weigh_strain(field, body, loose).square / body.step**2
    covariance = np.linalg.inv(square)[:-1, :-1]
    root = np.linalg.cholesky((covariance + covariance.T) / 2)
    asked = field.basis.evaluate(places[:: max(1, len(places) // ASKED)])
    columns = root.reshape(field.basis.count, 3, -1)
    spread = np.einsum("vm,mkc->vkc", asked, columns).reshape(3 * len(asked), -1)
    _, main = np.linalg.eigh(spread.T @ spread)
    largest = columns @ main[:, ::-1][:, :MODES]
    modes = np.einsum("vm,mkc->cvk", field.basis.evaluate(places), largest)
    if beyond is None:
        seen, spacing = found.material[np.abs(found.distance) < tolerance], find_spacing(body, points)
        beyond = BEYOND * go_beyond(places, seen, spacing)[None]
    modes = np.concatenate([modes, beyond])
    at = [one.freedom for one in trials].index(chosen.freedom) + 1
    alike = [one for one in trials[at:] if one.freedom.stretches == chosen.freedom.stretches]
    freer = alike[0] if alike else None
    if freer is None:
        return np.asarray(modes)
    return np.concatenate([modes, (freer.field.displace(places) - field.displace(places))[None]])


def measure_left(found: Match, weights: Floats, body: Body) -> float:
    """How far the worst small patches of intact skin lie off the field, beyond what noise explains, as a standard
    deviation: it is not followed there, may be as far off where the skin is gone, and sites are where it is."""
    _, number = number_cubes(found.points, body.mesh.diagonal / SMALL)
    _, patch, _ = group_integers(number)
    total = np.bincount(patch, weights)
    kept = total > FEWEST
    if not kept.any():
        return 0.0
    mean = np.bincount(patch, weights * found.distance)[kept] / total[kept]
    by_noise = body.noise**2 * np.bincount(patch, weights**2)[kept] / total[kept] ** 2
    largest = float(np.quantile(mean**2 - WIDTH**2 * by_noise, 1 - RARE))
    return float(np.sqrt(max(largest, 0.0))) / WIDTH


def go_beyond(places: Floats, seen: Floats, spacing: float) -> Floats:
    """(V,3) the way from the nearest of the seen places (N,3) to each of the places (V,3), less the ``spacing``."""
    from scipy.spatial import cKDTree

    distance, nearest = cKDTree(seen).query(places)
    share = np.maximum(1 - spacing / np.maximum(distance, 1e-300), 0.0)
    return np.asarray(share[:, None] * (places - seen[nearest]))


def find_spacing(body: Body, points: Floats) -> float:
    """How far skin may be from a point between points, where all of it is seen."""
    area = body.mesh.area
    return 2 * float(np.sqrt(area / max(len(points), 1)))


def _measure_error(distance: Floats, weights: Floats, points: Floats, body: Body) -> float:
    """The variance of one point, as if the errors of points were independent: larger than that of the noise where the
    means of patches deviate by more than noise explains."""
    patch, _ = cut_patches(points, body.mesh.diagonal)
    total = np.bincount(patch, weights)
    kept = total > 5
    mean = np.bincount(patch, weights * distance)[kept] / total[kept]
    square = float(np.median(mean**2 * total[kept])) / 0.455 if kept.any() else 0.0  # the median of a chi square
    return max(square, body.noise**2)
