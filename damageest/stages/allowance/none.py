"""No allowance: what is deposited is the damage volume itself."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Solid
from damageest.stages.allowance import Allowance


class NoAllowance(Allowance):
    """Deposits the damage volume as it is, with no stock to mill back."""

    use: Literal["none"] = "none"

    def run(self, damage: Solid) -> Solid | None:
        """Always None: no deposit other than the damage volume."""
        return None
