"""Stage `sample`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Samples
from damageest.stages import Stage, asked_by_name


class Sample(Stage, ABC):
    """Gives points on the part's surface (paper 3.1 step 1), no gap larger than the spacing it states."""

    stage: ClassVar[str] = "sample"
    gives: ClassVar[str] = "samples"

    @asked_by_name
    @abstractmethod
    def run(self, part: Part, tolerance: float) -> Samples: ...
