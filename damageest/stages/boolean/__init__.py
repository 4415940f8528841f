"""Stage `boolean`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Solid
from damageest.stages import Stage, asked_by_name


class Boolean(Stage, ABC):
    """Intersects an enclosure with the part: the intersection is the damage volume (paper 3.1 step 12).

    Args of ``run``, both in the part's frame:
        solid: the watertight enclosure.
        part: the part as designed.

    Returns:
        The intersection as a solid of one or more pieces; None where the two have no volume in common.

    Raises:
        StageError: where one of the meshes is refused, or where the result is not watertight.

    Example::

        from typing import Literal
        from damageest.artefacts import Part, Solid
        from damageest.errors import StageError
        from damageest.geometry.solids import to_manifold, to_solid
        from damageest.stages.boolean import Boolean

        class Intersect(Boolean):
            "Intersection by manifold3d; for any solid."
            use: Literal["intersect"] = "intersect"

            def run(self, solid: Solid, part: Part) -> Solid | None:
                origin = part.bounds.mean(axis=0)  # near the origin, rounding errors are smallest
                try:
                    return to_solid(to_manifold(part, origin) ^ to_manifold(solid, origin), origin)
                except ValueError as error:
                    raise StageError(str(error), "repair: pymeshfix") from None
    """

    stage: ClassVar[str] = "boolean"
    gives: ClassVar[str] = "damage"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, solid: Solid, part: Part) -> Solid | None: ...
