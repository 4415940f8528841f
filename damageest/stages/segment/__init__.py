"""Stage `segment`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Part, Samples, Scan
from damageest.stages import Stage, asked_by_name


class Segment(Stage, ABC):
    """Gives each scan point's signed distance to the part, and its label (paper 3.1 step 4).

    ``aligned``: the scan in the part's frame. DAMAGE: inside by more than ``tolerance``, or by less
    where a whole region shows it; ADDED: outside by more.
    """

    stage: ClassVar[str] = "segment"
    gives: ClassVar[str] = "deviation"

    @asked_by_name
    @abstractmethod
    def run(self, aligned: Scan, part: Part, samples: Samples, tolerance: float) -> Deviation: ...
