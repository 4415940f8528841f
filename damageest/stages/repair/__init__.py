"""Stage `repair`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Mesh, Solid
from damageest.stages import Stage, asked_by_name


class Repair(Stage, ABC):
    """Makes an enclosure watertight, or refuses it (paper 3.1 step 11).

    Args of ``run``:
        enclosure: the mesh that `enclose` gave, in the part's frame; it may have holes, faces that are turned the wrong
            way, or self-intersections.
        tolerance: how far the repaired mesh may lie from the given one, in the job's unit.

    Returns:
        A solid of the same shape. The constructor of `Solid` checks that it is watertight and has positive volume. A
        mesh that is watertight already keeps its volume.

    Raises:
        StageError: where the mesh is empty or cannot be made watertight without a change of shape.

    Example::

        from typing import Literal
        import trimesh
        from damageest.artefacts import Mesh, Solid
        from damageest.errors import StageError
        from damageest.stages.repair import Repair

        class FillSmallHoles(Repair):
            "Fills holes of three or four edges by trimesh."
            use: Literal["fill_small_holes"] = "fill_small_holes"

            def run(self, enclosure: Mesh) -> Solid:
                mesh = trimesh.Trimesh(enclosure.vertices, enclosure.faces)
                mesh.fill_holes()
                try:
                    return Solid(mesh.vertices, mesh.faces)
                except ValueError as error:
                    raise StageError(f"the enclosure cannot be repaired: {error}", "repair: pymeshfix") from None
    """

    stage: ClassVar[str] = "repair"
    gives: ClassVar[str] = "solid"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, enclosure: Mesh, tolerance: float) -> Solid: ...
