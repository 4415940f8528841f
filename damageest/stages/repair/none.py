"""No repair: only the check that there is nothing to repair."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Mesh, Solid
from damageest.errors import StageError
from damageest.stages.repair import Repair


class NoRepair(Repair):
    """Passes a watertight mesh on and refuses any other. Right wherever the enclosure is closed by construction."""

    use: Literal["none"] = "none"

    def run(self, enclosure: Mesh) -> Solid:
        """Raises StageError where the mesh is open, or encloses no volume."""
        try:
            return Solid(enclosure.vertices, enclosure.faces)
        except ValueError as error:
            remedy = "method: implicit, which closes by construction, or a repairing plugin"
            raise StageError(f"the enclosure is {error}", remedy) from None
