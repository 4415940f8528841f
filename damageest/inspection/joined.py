"""Bodies that were scanned with the part, as fixtures: what of them is joined to the part at a site is the part's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Flags, Ints
from damageest.geometry.vectors import to_vector
from damageest.inspection.discrepancies import Finding
from damageest.inspection.places import Landed, Places
from damageest.result import Result

TOUCHING, SPACINGS = 3.0, 2.0
"""Height above the skin, in tolerances and in spacings of the scan, up to which a body's points touch the part."""
HIGHEST = 10.0
"""Height in tolerances up to which the points of a body that touches a site count there: above is the body's own."""
FEWEST = 3
"""Points of a body that touch a site's skin where it is joined to it."""
NOTE = (
    "a body beside the part touches the finished skin of {where} and counts as excess metal; if it is a fixture, "
    "name it in the job:  inspect: {{fixtures: [{{min: [..], max: [..]}}]}}, or scan without it"
)


@dataclass(frozen=True)
class Bodies:
    """Which body beside the part each scan point belongs to: ``of`` (N,), 0 for none, from 1 up. ``count`` bodies."""

    of: Ints
    count: int


def find_bodies(result: Result) -> Bodies:
    """The bodies that the run took for surroundings."""
    of = np.zeros(len(result.aligned.points), np.int64)
    found = [item for item in result.surplus if item.kind == "surroundings"]
    for number, item in enumerate(found, 1):
        of[item.points] = number
    return Bodies(of, len(found))


def keep_joined(landed: Landed, bodies: Bodies, tolerance: float, spacing: float) -> Landed:
    """The points on a site's skin, without those of bodies that do not touch it."""
    body = bodies.of[landed.index]
    touching = (body > 0) & (landed.distance <= max(TOUCHING * tolerance, SPACINGS * spacing))
    joined = np.bincount(body[touching], minlength=bodies.count + 1) >= FEWEST
    joined[0] = True
    kept = joined[body] & ((body == 0) | (landed.distance <= max(HIGHEST * tolerance, SPACINGS * spacing)))
    return _take(landed, kept)


def list_joined(
    result: Result, bodies: Bodies, places: Mapping[int, Places | None], landed: Mapping[int, Landed]
) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """The findings, and a note for each, of bodies that are joined to the part within sites."""
    found, notes = [], []
    for number in range(1, bodies.count + 1):
        sites, volume, height, at = [], 0.0, 0.0, []
        for site, one in landed.items():
            own, skin = bodies.of[one.index] == number, places[site]
            if skin is None or not own.any():
                continue
            sites.append(site)
            share = np.bincount(one.place, own, skin.count) / np.maximum(
                np.bincount(one.place, minlength=skin.count), 1
            )
            sums = np.bincount(one.place, own * one.distance, skin.count)
            mean = sums / np.maximum(np.bincount(one.place, own, skin.count), 1)
            area = np.bincount(skin.of, minlength=skin.count) * skin.skin.area
            volume += float((area * share * mean).sum())
            height = max(height, float(one.distance[own].max()))
            at.append(result.aligned.points[one.index[own]])
        if sites:
            centre = to_vector(np.concatenate(at).mean(axis=0))
            found.append(Finding("over", sites[0], volume, None, None, height, centre, "estimated", tuple(sites)))
            where = f"site{'s' * (len(sites) > 1)} {', '.join(map(str, sites))}"
            notes.append(NOTE.format(where=where))
    return tuple(found), tuple(notes)


def _take(landed: Landed, kept: Flags) -> Landed:
    return replace(
        landed, index=landed.index[kept], feet=landed.feet[kept], place=landed.place[kept],
        distance=landed.distance[kept],
    )  # fmt: skip
