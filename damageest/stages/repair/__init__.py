"""Stage `repair`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Mesh, Solid
from damageest.stages import Stage


class Repair(Stage, ABC):
    """Gives a watertight mesh, or refuses (paper 3.1 step 11)."""

    stage: ClassVar[str] = "repair"
    takes: ClassVar[Mapping[str, object]] = {"enclosure": Mesh, "tolerance": float}
    gives: ClassVar[str] = "solid"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Solid: ...
