"""A damage site, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import DepositPath, Evidence, Floats, Mesh, Reason, Solid, Surface
from damageest.findings import Verdict
from damageest.intervals import Fading, Interval, Uncertainty
from damageest.io.conversions import as_manifold, as_trimesh


@dataclass(frozen=True, eq=False)
class Site:
    """One damage: ``damage`` (DV) and ``surface`` (IDS) in the part's frame; ``deposit`` None where it is the DV.

    After a cut-back alone, DV and IDS are those of the enlarged cavity. ``refused``: the stage `allowance` failed, and
    there is no deposit. ``clusters``: the numbers of the point clusters that bound it; ``points`` (M,) indices into the
    scan. ``enclosures``: the closed surfaces that cut the DV out of the part; none where that is a whole body of the
    part. ``path``: the passes that build up the deposit.
    """

    id: int
    clusters: tuple[int, ...]
    points: NDArray[np.int64]
    damage: Solid
    surface: Surface
    deposit: Solid | None
    method: Annotated[
        str,
        "surface: site by site; rays: a whole body of the part; pore: a closed cavity inside the metal; "
        "otherwise the implementation that took all sites at once",
    ]
    evidence: Evidence
    max_depth: Annotated[float, "largest depth of the scan below the lost skin"]
    warnings: Annotated[tuple[Reason, ...], "notes of stages on the site; they change no verdict"] = ()
    refused: bool = False
    verdict: Verdict = field(default_factory=Verdict)
    accepted: Annotated[bool, "whether it is part of damage_volume; a doubtful site is where the job says so"] = True
    volume_rates: Annotated[
        tuple[float, ...], "change of the volume for each unit of each motion of alignment.free"
    ] = ()
    uncertainty: Uncertainty | None = None
    enclosures: tuple[Solid, ...] = ()
    path: Annotated[DepositPath | None, "null where the job asks for none, or none could be planned"] = None

    @property
    def volume_95(self) -> Interval | None:
        """The 95 % interval of the volume of ``damage``; None where the scan does not support one."""
        return self.uncertainty.volume_95 if self.uncertainty else None

    @property
    def depth_95(self) -> Interval | None:
        """The 95 % interval of the largest depth of the loss, which ``max_depth``, of single points, exceeds by noise;
        None where the scan does not support one."""
        return self.uncertainty.depth_95 if self.uncertainty else None

    @property
    def fading(self) -> Fading | None:
        """How a shallow loss fades out; None for a loss with a sharp rim."""
        return self.uncertainty.fading if self.uncertainty else None

    @cached_property
    def centroid(self) -> Floats:
        """(3,) centre of mass of the damage volume."""
        centre = self.damage.bounds.mean(0)
        corners = self.damage.triangles - centre
        weights = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        moment = (weights[:, None] * corners.sum(1)).sum(0) / (4 * weights.sum())
        return np.asarray(centre + moment)

    def mesh(self, what: Literal["damage", "surface", "deposit"]) -> Mesh:
        """The DV, the IDS, or the deposit, which is the DV without an allowance. Raises ValueError."""
        if what == "deposit" and self.refused:
            raise ValueError(f"site {self.id} has no deposit: the stage allowance refused it; see Result.failures")
        found = {"damage": self.damage, "surface": self.surface, "deposit": self.deposit or self.damage}
        return choose_mesh(found, what, f"site {self.id}")

    def as_trimesh(self, what: Literal["damage", "surface", "deposit"] = "damage") -> Any:
        """A ``trimesh.Trimesh`` in the part's frame; see `mesh`."""
        return as_trimesh(self.mesh(what))

    def as_manifold(self, what: Literal["damage", "deposit"] = "damage") -> Any:
        """A ``manifold3d.Manifold`` in the part's frame; see `mesh`."""
        return as_manifold(require_solid(self.mesh(what), what))


def choose_mesh(found: Mapping[str, Mesh | None], what: str, owner: str) -> Mesh:
    if what not in found:
        raise ValueError(f"{owner} has no '{what}'; there are: {', '.join(found)}")
    mesh = found[what]
    if mesh is None:
        raise ValueError(f"{owner} has no {what}: nothing is {'left' if what == 'undamaged' else 'lost'}")
    return mesh


def require_solid(mesh: Mesh, what: str) -> Solid:
    if not isinstance(mesh, Solid):
        raise ValueError(f"{what} is an open mesh, and manifold3d takes solids; take as_trimesh")
    return mesh
