"""Stage `background`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Solid, Surface
from damageest.stages import Stage


class Background(Stage, ABC):
    """Gives a closed mesh that holds part and IDS completely (paper 3.1 step 7)."""

    stage: ClassVar[str] = "background"
    takes: ClassVar[Mapping[str, object]] = {"part": Part, "surface": Surface, "tolerance": float, "spacing": float}
    gives: ClassVar[str] = "background"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Solid: ...
