"""Stage `allowance`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage


class Allowance(Stage, ABC):
    """Gives what is to be deposited for one damage volume; None where that is the damage volume itself.

    ``others``: the damage volumes of all other sites as one solid, or None. Where a `Deposit` with a cavity is given,
    the cavity takes the damage volume's place in the result.
    """

    stage: ClassVar[str] = "allowance"
    takes: ClassVar[Mapping[str, object]] = {"damage": Solid, "part": Part, "tolerance": float, "others": Solid}
    gives: ClassVar[str] = "deposit"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Solid | None: ...
