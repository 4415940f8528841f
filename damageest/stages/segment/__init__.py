"""Stage `segment`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Deviation, Part, Samples, Scan
from damageest.stages import Stage


class Segment(Stage, ABC):
    """Gives each scan point's signed distance to the part, and its label (paper 3.1 step 4).

    ``aligned``: the scan in the part's frame. DAMAGE: inside by more than ``tolerance``, or by less
    where a whole region shows it; ADDED: outside by more.
    """

    stage: ClassVar[str] = "segment"
    takes: ClassVar[Mapping[str, object]] = {"aligned": Scan, "part": Part, "samples": Samples, "tolerance": float}
    gives: ClassVar[str] = "deviation"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Deviation: ...
