"""Stage `cluster`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Scan, Sites
from damageest.stages import Stage, asked_by_name


class Cluster(Stage, ABC):
    """Gives the damage sites: which scan points lie on which damage (paper 3.3)."""

    stage: ClassVar[str] = "cluster"
    gives: ClassVar[str] = "sites"

    @asked_by_name
    @abstractmethod
    def run(self, aligned: Scan, deviation: Deviation, tolerance: float) -> Sites: ...
