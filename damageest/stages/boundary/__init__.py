"""Stage `boundary`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Rims, Surface
from damageest.stages import Stage


class Boundary(Stage, ABC):
    """Gives the rim, or rims, of an IDS (paper 3.1 step 6)."""

    stage: ClassVar[str] = "boundary"
    takes: ClassVar[Mapping[str, object]] = {"surface": Surface, "part": Part, "tolerance": float}
    gives: ClassVar[str] = "rims"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Rims: ...
