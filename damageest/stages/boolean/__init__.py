"""Stage `boolean`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage


class Boolean(Stage, ABC):
    """Gives the part of ``solid`` that lies in the part (paper 3.1 step 12); None where there is none."""

    stage: ClassVar[str] = "boolean"
    takes: ClassVar[Mapping[str, object]] = {"solid": Solid, "part": Part}
    gives: ClassVar[str] = "damage"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Solid | None: ...
