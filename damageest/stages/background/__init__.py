"""Stage `background`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Floats, Part, Samples, Solid, Surface
from damageest.stages import Stage, asked_by_name


class Background(Stage, ABC):
    """Gives a closed mesh that holds the IDS, the lost material and the part around them (paper 3.1 step 7).

    ``fine``: whether its vertices have to lie close together everywhere, as where `enclose` does not refine it itself.
    ``intact`` (K,3): scan points on the nominal surface; ``samples``: CAD points on all of it.
    """

    stage: ClassVar[str] = "background"
    gives: ClassVar[str] = "background"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(
        self,
        part: Part,
        surface: Surface,
        tolerance: float,
        spacing: float,
        fine: bool,
        intact: Floats,
        samples: Samples,
    ) -> Solid: ...
