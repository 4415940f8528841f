"""Stage `allowance`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage, asked_by_name


class Allowance(Stage, ABC):
    """Makes the solid to deposit for one site: its damage volume and, on top, stock to mill off again.

    Args of ``run``, in the part's frame, lengths in the job's unit:
        damage: the site's damage volume (DV), watertight, inside the part.
        part: the part as designed.
        tolerance: the job's tolerance; it also says how exact the deposit has to be.
        others: the damage volumes of all other sites as one solid; None where there are none.

    Returns:
        None where the DV itself is deposited. Else a solid that contains the DV and takes no volume from the metal that
        is left. Give a `Deposit` to report stock, thickness and warnings. Where its ``cavity`` is set, the cavity
        replaces the DV in the result: it is what has to be cut out before deposition.

    Raises:
        StageError: where there is no room for the deposit. The site then keeps its DV and has no deposit.

    Example::

        from typing import Literal
        from damageest.artefacts import Deposit, Part, Solid
        from damageest.geometry.solids import to_manifold, to_solid
        from damageest.stages.allowance import Allowance

        class FillHull(Allowance):
            "Deposits the convex hull of the damage volume, minus the metal that is left; for damaged convex skin."
            use: Literal["fill_hull"] = "fill_hull"

            def run(self, damage: Solid, part: Part) -> Solid | None:
                origin = part.bounds.mean(axis=0)  # near the origin, rounding errors are smallest
                lost, whole = to_manifold(damage, origin), to_manifold(part, origin)
                body = to_solid(lost + (lost.hull() - whole), origin)
                if body is None:
                    return None
                return Deposit(body.vertices, body.faces, stock_volume=max(body.volume - damage.volume, 0.0))
    """

    stage: ClassVar[str] = "allowance"
    gives: ClassVar[str] = "deposit"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, damage: Solid, part: Part, tolerance: float, others: Solid | None) -> Solid | None: ...
