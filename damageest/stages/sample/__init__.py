"""Stage `sample`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Samples
from damageest.stages import Stage


class Sample(Stage, ABC):
    """Gives points on the part's surface (paper 3.1 step 1), no gap larger than the spacing it states."""

    stage: ClassVar[str] = "sample"
    takes: ClassVar[Mapping[str, object]] = {"part": Part, "tolerance": float}
    gives: ClassVar[str] = "samples"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Samples: ...
