"""Stage `boundary`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Rims, Surface
from damageest.stages import Stage, asked_by_name


class Boundary(Stage, ABC):
    """Gives the rim, or rims, of an IDS (paper 3.1 step 6)."""

    stage: ClassVar[str] = "boundary"
    gives: ClassVar[str] = "rims"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, surface: Surface, part: Part, tolerance: float) -> Rims: ...
