"""Stage `reconstruct`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Floats, Part, Surface
from damageest.stages import Stage


class Reconstruct(Stage, ABC):
    """Gives the inner damage surface (IDS) of one site as an open mesh (paper 3.1 step 5).

    ``points`` (M,3): the site's points in the part's frame. ``spacing`` and ``noise``: those of the scan.
    """

    stage: ClassVar[str] = "reconstruct"
    takes: ClassVar[Mapping[str, object]] = {
        "points": Floats,
        "part": Part,
        "tolerance": float,
        "spacing": float,
        "noise": float,
    }
    gives: ClassVar[str] = "surface"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Surface: ...
