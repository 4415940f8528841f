"""Stage `allowance`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage, asked_by_name


class Allowance(Stage, ABC):
    """Gives what is to be deposited for one damage volume; None where that is the damage volume itself.

    ``others``: the damage volumes of all other sites as one solid, or None. Where a `Deposit` with a cavity is given,
    the cavity takes the damage volume's place in the result.
    """

    stage: ClassVar[str] = "allowance"
    gives: ClassVar[str] = "deposit"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, damage: Solid, part: Part, tolerance: float, others: Solid | None) -> Solid | None: ...
