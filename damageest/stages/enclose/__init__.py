"""Stage `enclose`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Enclosures, Floats, Mesh, Part, Rims, Samples, Scan, Sites, Solid, Surface
from damageest.errors import StageError
from damageest.stages import Stage, asked_by_name


class NotSeparatedError(StageError):
    """The rims of an IDS do not split the background: it bounds a loss only together with others."""


class Enclose(Stage, ABC):
    """Gives a closed mesh round the damage of one site: IDS, rim, and the background that they cut off.

    Paper 3.1 steps 8 to 11. ``intact`` (K,3): scan points on the nominal surface, which the enclosure must leave out.
    ``points`` (M,3): the site's own. The mesh need not be watertight yet: `repair` follows. ``refines``: whether it
    refines the background itself where it needs to. Raises NotSeparatedError where the IDS alone cuts nothing off; such
    IDSs are then tried together, as the two faces of a ring's missing piece.
    """

    refines: ClassVar[bool] = False

    stage: ClassVar[str] = "enclose"
    gives: ClassVar[str] = "enclosure"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(
        self,
        surface: Surface,
        rims: Rims,
        background: Solid,
        part: Part,
        intact: Floats,
        points: Floats,
        tolerance: float,
    ) -> Mesh: ...


class EncloseAll(Stage, ABC):
    """Gives enclosures for all sites of the job at once; for routes that do not go site by site.

    ``method``: the value of the job's `method` that chooses the implementation. A plugin may name a method of its own:
    the job file then knows it.
    """

    method: ClassVar[str] = "implicit"

    stage: ClassVar[str] = "enclose"
    gives: ClassVar[str] = "enclosures"

    @asked_by_name
    @abstractmethod
    def run(
        self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, samples: Samples, tolerance: float
    ) -> Enclosures: ...
