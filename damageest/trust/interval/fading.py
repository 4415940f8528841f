"""How a shallow loss fades out: its volume at several thresholds, and what is lost beyond its rim.

Wear has no edge. A point counts as lost where it, or the mean of its neighbours, is deep enough; so where wear ends is
the tolerance's to say, and its volume depends on it. Means over patches of skin beside the site show what the site
leaves out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import Flags, Floats, Solid
from damageest.findings import Fading
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin import take_inner_surface
from damageest.geometry.voxels import number_faced_cubes
from damageest.trust.skin.coverage import SkinView, find_removed_cells
from damageest.trust.skin.skin_cells import AVERAGED

SHALLOW = 4.0
"""Depth in tolerances of half the skin of a site up to which it is shallow."""
SAMPLES = 2000
"""Places on the skin at which the depth is measured."""
FIRST = 10
"""Every so many of these places tell whether the site is shallow at all."""
PATCH = 3.0
"""Edge of a patch in edges of a skin cell."""
SIGNIFICANT = 3.0
"""Standard deviations from which the mean of a patch is lower than intact skin."""
LEAST = 0.05
"""Depth in tolerances below which a patch does not count as lost."""
BESIDE = 2.5
"""Distance in edges of a patch up to which patches are connected."""


def measure_fading(
    damage: Solid, inner: Flags, skin: SkinView, noise: float, systematic: float, tolerance: float,
    others: Callable[[], Flags],
) -> Fading | None:  # fmt: skip
    """The volumes of a shallow loss; None for a deeper one.

    Args:
        inner: (F,) which faces of ``damage`` are on its inner surface.
        systematic: how far intact skin deviates over whole areas: less is no loss.
        others: gives the cells (C,) of the skin that other sites remove; it is called for a shallow loss only.
    """
    on_skin = np.flatnonzero(~inner & (damage.face_areas > 0))
    if not len(on_skin) or not inner.any():
        return None
    places, _ = sample_by_area(damage, SAMPLES, np.random.default_rng(0), on_skin)
    bottom = take_inner_surface(damage, inner)
    if float(np.median(distance_to_mesh(places[::FIRST], bottom))) > SHALLOW * tolerance:
        return None
    depth = distance_to_mesh(places, bottom)
    if not depth.any():
        return None
    beyond_depth, beyond_area = _find_beyond(damage, skin, noise, systematic, tolerance, others())
    inside = damage.volume / float(depth.sum())

    def count_from(least: float) -> float:
        low = beyond_depth >= least
        return inside * float(depth[depth >= least].sum()) + float(beyond_depth[low] @ beyond_area[low])

    return Fading(
        half=count_from(tolerance / 2),
        at=count_from(tolerance),
        twice=count_from(2 * tolerance),
        beyond=float(beyond_depth @ beyond_area),
    )


def _find_beyond(
    damage: Solid, skin: SkinView, noise: float, systematic: float, tolerance: float, others: Flags
) -> tuple[Floats, Floats]:
    """Depth (P,) and area (P,) of patches of skin beside a site that are lower than noise explains, connected to it."""
    cells = skin.cells
    nothing = np.empty(0), np.empty(0)
    own = find_removed_cells(damage, skin)
    asked = np.flatnonzero(skin.perhaps_seen & np.isfinite(skin.distance) & ~own & ~others)
    if not len(asked) or not own.any():
        return nothing
    edge = PATCH * cells.edge
    _, number = number_faced_cubes(cells.centres[asked], cells.normals[asked], edge)
    _, group, count = np.unique(number, return_inverse=True, return_counts=True)
    weight = cells.areas[asked]
    area: Floats = np.bincount(group, weights=weight).astype(np.float64)
    depth: Floats = -np.bincount(group, weights=weight * skin.distance[asked]) / area
    centre = np.stack([np.bincount(group, weights=weight * c) / area for c in cells.centres[asked].T], axis=1)
    chance = np.hypot(noise / np.sqrt(AVERAGED * count / 2), systematic)
    low = (depth > SIGNIFICANT * chance) & (depth > LEAST * tolerance)
    if not low.any():
        return nothing
    joined = _connect(centre[low], cells.centres[own], BESIDE * edge / 2)
    return depth[low][joined], area[low][joined]


def _connect(places: Floats, start: Floats, link: float) -> Flags:
    """Which places (P,3) are connected to those of ``start`` (S,3) by steps of at most ``link``."""
    joined = find_neighbours(places, 1, start)[0][:, 0] <= link
    for _ in range(len(places)):
        if not joined.any() or joined.all():
            break
        rest = np.flatnonzero(~joined)
        new = rest[find_neighbours(places[rest], 1, places[joined])[0][:, 0] <= link]
        if not len(new):
            break
        joined[new] = True
    return joined
