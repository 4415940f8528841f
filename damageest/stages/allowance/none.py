"""No allowance: the damage volume itself is deposited."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Solid
from damageest.stages.allowance import Allowance


class NoAllowance(Allowance):
    """Deposits the damage volume itself, without stock to mill off."""

    use: Literal["none"] = "none"

    def run(self, damage: Solid) -> Solid | None:
        """None: nothing but the damage volume is deposited."""
        return None
