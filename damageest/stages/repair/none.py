"""No repair: only the check that the enclosure is watertight."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Mesh, Solid
from damageest.errors import StageError
from damageest.stages.repair import Repair


class NoRepair(Repair):
    """Passes a watertight mesh on and refuses any other. For enclosures that are closed by construction."""

    use: Literal["none"] = "none"

    def run(self, enclosure: Mesh) -> Solid:
        """Raises StageError where the mesh is open, or encloses no volume."""
        try:
            return Solid(enclosure.vertices, enclosure.faces)
        except ValueError as error:
            raise StageError(f"the enclosure is {error}", "repair: pymeshfix", method="implicit") from None
