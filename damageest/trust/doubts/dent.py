"""Whether a loss may be a dent: metal that moved, of a wall of which one side was seen.

A dent in sheet metal and a shallow pit look alike from outside. What tells them apart is the other side of the wall, or
an edge: metal that is cut, chipped or pitted ends at one, metal that is bent fades out on both sides of any depth.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from damageest.artefacts import ADDED, Floats, Ints, Part, Reason, Solid
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours
from damageest.geometry.rays import measure_thickness
from damageest.geometry.scan_field import ScanField
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts
from damageest.trust.skin.coverage import SkinView, find_removed_cells

BENDABLE = 0.5
"""Thickness of a wall, in widths of the loss, up to which it may have been bent there."""
SEEN = 0.3
"""Share of the wall's other side that the scan shows from which that side tells what happened."""
SHALLOW, DEEP = 0.1, 1.9
"""Depths in those of the rim, where the loss was found to end: of a loss that ends at an edge, its flank takes the same
width from one to the rim, and from there to the other."""
FADES, FADES_SPACINGS = 1.5, 1.0
"""How many times wider, and by how many point spacings more, the way outward is where a loss has no edge."""
FEWEST = 8
"""Points of a ring around the rim, at least, for their mean depth to count."""
NEAR = 16
"""Rings that are looked at first; four times as many each time after that."""
WIDEST = 3.0
"""How far out rings are looked at, in widths of the loss."""


class Dent(Rule):
    code = "dent"
    meaning = "the loss may be a dent: it has no edge, and the other side of a thin wall was not seen"
    threshold = "a wall up to half as thick as the loss is wide, of whose other side the scan shows less than 30 %"
    remedy = "scan the other side of the wall: a dent bulges there; a loss does not"
    rank = 250

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.bent_wall:
            text = (
                f"it may be a dent without lost metal: it has no edge, in a wall "
                f"{site.bent_wall:.3g} {scan.unit} thick whose other side is unseen"
            )
            yield Reason(self.code, text, "widens", site.volume, f"{scan.unit}³", remedy=self.remedy)


def find_bent_wall(damage: Solid, skin: SkinView, field: ScanField, members: Ints) -> float:
    """The thickness of the wall that may be dented where a loss was found; 0 where it is none, or not so.

    ``members`` (M,): the scan points of the loss. The wall's other side is near and was not seen, and no edge ends the
    loss.
    """
    own = find_removed_cells(damage, skin)
    if not own.any() or not len(members):
        return 0.0
    cells = skin.cells
    width = float(np.sqrt(cells.areas[own].sum()))
    thickness, other = _look_through(field.part, cells.centres[own], cells.normals[own])
    through = np.isfinite(thickness)
    if through.mean() < 0.5 or np.median(thickness[through]) > BENDABLE * width:
        return 0.0
    nearest = find_neighbours(other[through], 1, cells.centres)[1][:, 0]
    if skin.perhaps_seen[nearest].mean() > SEEN or _has_edge(field, members, width):
        return 0.0
    return float(np.median(thickness[through]))


def _look_through(part: Part, places: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """The thickness (N,) of the part below places on its skin (N,3), and the place on the other side (N,3)."""
    thickness = measure_thickness(part, places, normals)
    return thickness, places - np.where(np.isfinite(thickness), thickness, 0.0)[:, None] * normals


def _has_edge(field: ScanField, members: Ints, width: float) -> bool:
    """Whether a loss ends as abruptly outward as it does inward; so it does where too few points tell."""
    points, spacing = field.points, field.aligned.spacing
    is_own = np.zeros(len(points), bool)
    is_own[members] = True
    near = find_nearby(points, points[members], WIDEST * width)
    outer = near[~is_own[near] & (field.label[near] != ADDED)]
    if len(outer) < FEWEST or len(members) < FEWEST:
        return True
    ring = max(0.5 * spacing, 1e-9)
    beside, within = (_Side(points[own], -field.distance[own]) for own in (outer, members))
    rim = (beside.average_depth(within, 2 * ring) + within.average_depth(beside, 2 * ring)) / 2
    out = beside.find_level(within, ring, SHALLOW * rim, falls=True)
    into = within.find_level(beside, ring, DEEP * rim, falls=False)
    return out <= FADES * into + FADES_SPACINGS * spacing


class _Side(NamedTuple):
    """The points (N,3) on one side of a rim, and how deep (N,) each is below the skin."""

    points: Floats
    depth: Floats

    def average_depth(self, other: _Side, reach: float) -> float:
        """The mean depth of the points nearer than ``reach`` to the other side."""
        return float(np.mean(self.depth[find_neighbours(self.points, 1, other.points, reach)[0][:, 0] < reach]))

    def find_level(self, other: _Side, ring: float, level: float, falls: bool) -> float:
        """How far from the other side the mean depth of rings first falls below a level, or rises above it: the
        farthest ring where it does neither, and 0 where no ring has enough points."""
        number = NEAR
        while True:  # far points take long to look up, and few losses need them
            away = find_neighbours(self.points, 1, other.points, number * ring)[0][:, 0]
            near = away < number * ring
            of_ring = (away[near] / ring).astype(np.int64)
            count = np.bincount(of_ring)
            kept = np.flatnonzero(count >= FEWEST)
            mean = np.bincount(of_ring, weights=self.depth[near])[kept] / count[kept]
            there = kept[mean < level] if falls else kept[mean > level]
            if len(there):
                return float(ring * there[0])
            if near.all():
                return float(ring * kept[-1]) if len(kept) else 0.0
            number *= 4
