"""Stage `repair`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Mesh, Solid
from damageest.stages import Stage, asked_by_name


class Repair(Stage, ABC):
    """Gives a watertight mesh, or refuses (paper 3.1 step 11)."""

    stage: ClassVar[str] = "repair"
    gives: ClassVar[str] = "solid"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, enclosure: Mesh, tolerance: float) -> Solid: ...
