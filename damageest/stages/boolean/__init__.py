"""Stage `boolean`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage, asked_by_name


class Boolean(Stage, ABC):
    """Gives the part of ``solid`` that lies in the part (paper 3.1 step 12); None where there is none."""

    stage: ClassVar[str] = "boolean"
    gives: ClassVar[str] = "damage"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, solid: Solid, part: Part) -> Solid | None: ...
