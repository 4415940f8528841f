"""No path: the deposit is handed on as a solid."""

from __future__ import annotations

from typing import ClassVar, Literal

from damageest.artefacts import DepositPath
from damageest.stages.path import Path


class NoPath(Path):
    """Plans no passes; the deposit goes to another program as a solid."""

    use: Literal["none"] = "none"
    plans_paths: ClassVar[bool] = False

    def run(self) -> DepositPath | None:
        """None: there are no passes."""
        return None
