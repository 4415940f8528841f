"""Stage `reconstruct`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Floats, Part, Surface
from damageest.stages import Stage, asked_by_name


class Reconstruct(Stage, ABC):
    """Gives the inner damage surface (IDS) of one site as an open mesh (paper 3.1 step 5).

    ``points`` (M,3): the site's points in the part's frame. ``spacing`` and ``noise``: those of the scan.
    """

    stage: ClassVar[str] = "reconstruct"
    gives: ClassVar[str] = "surface"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface: ...
