"""What the scan shows of the part's skin, and what unseen skin may hide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Solid
from damageest.findings import Coverage, UnseenRegion
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.geometry.rays import prepare_rays
from damageest.trust.skin.ray_evidence import RayEvidence
from damageest.trust.skin.skin_cells import MOST_CELLS, SkinCells

LEAST_EDGE = 4.0
"""Edge of a square, in tolerances, whose area an unseen region has at least; smaller ones count in the share only."""
MOST_REGIONS = 50
VOLUME_POINTS = 10_000
"""Random points in the part that the volume behind each region is counted from."""

CLOSING: Literal["earlier scan"] = "earlier scan"
Why = Literal["unknown", "hidden", "outside", "no points", "earlier scan"]


@dataclass(frozen=True, eq=False)
class SkinView:
    """The skin in ``cells``; for each (F,) whether the scan has points on it, ``seen``, or has them so near that it
    perhaps shows it, ``perhaps_seen``, and their mean signed ``distance``, NaN without points; ``rays``: None where no
    scanner position is known."""

    cells: SkinCells
    seen: Flags
    perhaps_seen: Flags
    distance: Floats
    rays: RayEvidence | None


def measure_coverage(part: Part, skin: SkinView, losses: Sequence[Solid], tolerance: float, spacing: float) -> Coverage:
    """Describes what the scan shows. ``losses``: the damage volumes; skin that they remove was seen to be gone."""
    cells, rays = skin.cells, skin.rays
    seen = skin.seen | _find_removed(cells, skin.seen, losses, max(tolerance, spacing))
    is_skin = np.ones(len(seen), bool) if part.unseen is None else ~part.unseen[cells.parent]
    label, closing = cells.label_connected(~seen & is_skin), cells.label_connected(~seen & ~is_skin)
    label = np.where(closing >= 0, closing + label.max(initial=-1) + 1, label)
    regions, region = _describe_regions(part, cells, label, rays, (LEAST_EDGE * max(tolerance, spacing)) ** 2)
    share = float(cells.areas[seen & is_skin].sum() / max(cells.areas[is_skin].sum(), 1e-300))
    lost = rays.lost if rays else np.zeros(len(seen), bool)
    distance = np.where(skin.seen, skin.distance, np.nan)
    return Coverage(share, regions, cells.mesh, seen, distance, lost, region)


def find_removed_cells(damage: Solid, skin: SkinView) -> Flags:
    """Which cells (C,) of the skin a damage volume removes."""
    cells = skin.cells
    removed = np.zeros(len(cells.areas), bool)
    low, high = damage.bounds[0] - cells.edge, damage.bounds[1] + cells.edge
    near = ((cells.centres > low) & (cells.centres < high)).all(axis=1)
    index = np.flatnonzero(near)
    if len(index):
        removed[index] = distance_to_mesh(cells.centres[index], damage) < 1e-3 * cells.edge
    return removed


def _find_removed(cells: SkinCells, seen: Flags, losses: Sequence[Solid], reach: float) -> Flags:
    """Which unseen cells (F,) a damage volume removes."""
    removed = np.zeros(len(seen), bool)
    for loss in losses:
        low, high = loss.bounds[0] - reach, loss.bounds[1] + reach
        near = ~seen & (cells.centres > low).all(axis=1) & (cells.centres < high).all(axis=1)
        index = np.flatnonzero(near)
        if not len(index):
            continue
        removed[index[distance_to_mesh(cells.centres[index], loss) < 0.5 * reach]] = True
    return removed


def _describe_regions(
    part: Part, cells: SkinCells, label: Ints, rays: RayEvidence | None, least: float
) -> tuple[tuple[UnseenRegion, ...], Ints]:
    """The unseen regions, largest first, and the place (F,) of each cell in them, -1 for a cell in none."""
    region = np.full(len(label), -1, np.int64)
    if not (label >= 0).any():
        return (), region
    area = np.bincount(label[label >= 0], weights=cells.areas[label >= 0])
    chosen = [int(k) for k in np.argsort(-area, kind="stable")[:MOST_REGIONS] if area[k] >= least]
    place = np.full(len(area), -1, np.int64)
    place[chosen] = np.arange(len(chosen))
    region[label >= 0] = place[label[label >= 0]]
    volumes = _measure_volumes_behind(part, cells, region, len(chosen))
    out = []
    for number, volume in enumerate(volumes):
        own = np.flatnonzero(region == number)
        weight = cells.areas[own]
        corners = cells.mesh.triangles[own].reshape(-1, 3)
        faces = () if part.faces_brep is None else tuple(np.unique(part.faces_brep[cells.parent[own]]).tolist())
        out.append(
            UnseenRegion(
                float(weight.sum()),
                np.average(cells.centres[own], axis=0, weights=weight),
                np.array([corners.min(axis=0), corners.max(axis=0)]),
                faces,
                volume,
                _explain(own, weight, rays)
                if part.unseen is None or not part.unseen[cells.parent[own[0]]]
                else CLOSING,
            )
        )
    return tuple(out), region


def _explain(own: Ints, weight: Floats, rays: RayEvidence | None) -> Why:
    """The cause that most of a region's area has."""
    if rays is None:
        return "unknown"
    outside = rays.outside[own]
    hidden = rays.hidden[own] & ~outside
    shares: dict[Why, float] = {
        "hidden": float(weight[hidden].sum()),
        "outside": float(weight[outside].sum()),
        "no points": float(weight[~hidden & ~outside].sum()),
    }
    return max(shares, key=lambda name: shares[name])


def _thin_cells(cells: SkinCells, region: Ints) -> Ints:
    """Of a skin of very many triangles some cells, half a cell's usual edge apart, of the regions and of the rest."""
    if len(region) <= 4 * MOST_CELLS:
        return np.arange(len(region))
    picked = []
    for own in (np.flatnonzero(region < 0), np.flatnonzero(region >= 0)):
        picked.append(own[pick_one_per_cube(cells.centres[own], cells.edge / 2)] if len(own) else own)
    return np.concatenate(picked)


def _measure_volumes_behind(part: Part, cells: SkinCells, region: Ints, count: int) -> list[float]:
    """For each region the volume of the part that is nearer to its skin than to any other skin.

    A loss behind the region leaves no trace in the scan as long as it is within this volume.
    """
    if not count:
        return []
    rng = np.random.default_rng(0)
    low, high = part.bounds
    tried = rng.uniform(low, high, (4 * VOLUME_POINTS, 3))
    # a ray from a point inside leaves the part where it first meets the skin
    direction = np.array([0.36, 0.48, 0.8])
    _, face = prepare_rays(part).find_first(tried, np.broadcast_to(direction, tried.shape))
    inside = tried[(face >= 0) & (part.cross[face] @ direction > 0)]
    found = np.zeros(count)
    if len(inside):
        some = _thin_cells(cells, region)
        nearest = region[some[find_neighbours(inside, 1, cells.centres[some])[1][:, 0]]]
        found = np.bincount(nearest[nearest >= 0], minlength=count) * part.volume / len(inside)
    area = np.bincount(region[region >= 0], weights=cells.areas[region >= 0], minlength=count)
    coarse = 30 * part.volume / max(len(inside), 1)
    volumes = np.where(found > coarse, found, np.maximum(found, np.minimum(area**1.5 / 6, coarse)))
    return [float(volume) for volume in volumes]
