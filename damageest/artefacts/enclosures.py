"""What bounds a damage, and how well the scan agrees with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from damageest.artefacts.arrays import Ints
from damageest.artefacts.meshes import Solid

EvidenceCause = Literal["residual", "inside", "contradicted", "bare", "shallow", "unseen"]


@dataclass(frozen=True, eq=False)
class Rims:
    """Closed loops of vertex indices of an IDS, each following the surface's own boundary edges, longest first."""

    loops: tuple[Ints, ...]


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A solid that contains the damage of ``sites`` and no intact metal; ``notes`` say what is doubtful about it."""

    solid: Solid
    sites: tuple[int, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Enclosures:
    """The enclosures of all sites of a job: disjoint, each site in one of them."""

    items: tuple[Enclosure, ...]


@dataclass(frozen=True)
class Evidence:
    """The check of one damage volume (DV) against the scan.

    ``ids_residual``: 95th percentile of the distance from the site's IDS points to the DV's boundary.
    ``intact_points_inside``: intact scan points on the skin that the DV removes.
    ``skin_contradicted``: share of the part's skin that the DV removes which intact scan points lie on.
    ``skin_unseen``: share of the part's skin beside the DV that has no scan point: no evidence either way.
    ``ids_unseen``: share of its inner surface without scan points near: there it is interpolated. ``ids_gap``: area of
    the largest connected piece of that.
    ``intact_share``: share of the skin that the DV removes on which intact points lie as densely as elsewhere, also
    near the rim; 0 where they are fewer than four. Unlike ``skin_contradicted``, it is measured on shallow and small
    sites too. ``consistent``: whether the scan agrees with the DV. ``causes``: the checks that say it does not.
    """

    ids_residual: float = 0.0
    intact_points_inside: int = 0
    skin_contradicted: float = 0.0
    skin_unseen: float = 0.0
    ids_unseen: float = 0.0
    ids_gap: float = 0.0
    intact_share: float = 0.0
    consistent: bool = True
    causes: tuple[EvidenceCause, ...] = ()
