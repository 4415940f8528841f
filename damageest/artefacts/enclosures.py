"""What bounds a damage, and how well the scan agrees with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from damageest.artefacts.arrays import Ints
from damageest.artefacts.fields import ArtefactError, Checked, make_array, require_shape
from damageest.artefacts.meshes import Solid

EvidenceCause = Literal["residual", "inside", "contradicted", "bare", "shallow", "unseen"]


@dataclass(frozen=True, eq=False)
class Rims(Checked):
    """Closed loops of vertex indices of an IDS, each following the surface's own boundary edges, longest first."""

    loops: tuple[Ints, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.loops, (tuple, list)):
            raise ArtefactError(f"loops: expected a tuple of arrays, got a {type(self.loops).__name__}")
        object.__setattr__(self, "loops", tuple(make_array(loop, np.int64, "loops") for loop in self.loops))
        for loop in self.loops:
            require_shape("loops", loop, "N")
            if len(loop) < 3 or loop.min() < 0 or len(np.unique(loop)) < len(loop):
                raise ArtefactError("loops: each needs three or more vertices, from 0 up, and each of them once")


@dataclass(frozen=True, eq=False)
class Enclosure(Checked):
    """A solid that contains the damage of ``sites`` and no intact metal; ``notes`` say what is doubtful about it."""

    solid: Solid
    sites: tuple[int, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.sites:
            raise ArtefactError("sites: an enclosure belongs to one site or more")


@dataclass(frozen=True, eq=False)
class Enclosures(Checked):
    """The enclosures of all sites of a job: disjoint, each site in one of them."""

    items: tuple[Enclosure, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        sites = [site for item in self.items for site in item.sites]
        if twice := sorted({site for site in sites if sites.count(site) > 1}):
            raise ArtefactError(f"items: site {twice[0]} is in more than one enclosure, or twice in one")


@dataclass(frozen=True)
class Evidence:
    """The check of one damage volume (DV) against the scan. ``intact_share``: where intact points lie as densely as
    elsewhere; 0 where they are fewer than four. Unlike ``skin_contradicted``, it is measured on shallow and small sites
    too."""

    ids_residual: Annotated[float, "95th percentile of the IDS points' distance to the damage volume"] = 0.0
    intact_points_inside: Annotated[int, "intact scan points on the skin that it removes"] = 0
    skin_contradicted: Annotated[float, "share of the removed skin that intact scan points lie on"] = 0.0
    skin_unseen: Annotated[float, "share of the skin beside the damage that the scan does not show"] = 0.0
    ids_unseen: Annotated[float, "share of its inner surface without scan points near, interpolated"] = 0.0
    ids_gap: Annotated[float, "area of the largest connected piece of inner surface without scan points near"] = 0.0
    intact_share: Annotated[float, "share of the removed skin, rim included, that intact points lie on"] = 0.0
    consistent: Annotated[bool, "whether the scan agrees with the damage volume"] = True
    causes: Annotated[tuple[EvidenceCause, ...], "the checks that say it does not"] = ()
