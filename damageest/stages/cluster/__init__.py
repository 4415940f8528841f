"""Stage `cluster`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Deviation, Scan, Sites
from damageest.stages import Stage


class Cluster(Stage, ABC):
    """Gives the damage sites: which scan points lie on which damage (paper 3.3)."""

    stage: ClassVar[str] = "cluster"
    takes: ClassVar[Mapping[str, object]] = {"aligned": Scan, "deviation": Deviation, "tolerance": float}
    gives: ClassVar[str] = "sites"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Sites: ...
