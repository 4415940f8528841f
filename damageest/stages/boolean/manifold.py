"""Booleans by manifold3d."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Part, Solid
from damageest.errors import StageError
from damageest.stages.boolean import Boolean


class Manifold(Boolean):
    """Intersection by manifold3d (Emmett Lalish), in double precision. Fast, and the result is always watertight."""

    use: Literal["manifold"] = "manifold"

    def run(self, solid: Solid, part: Part) -> Solid | None:
        """The part of ``solid`` inside ``part`` (paper 3.1 step 12). Raises StageError where manifold3d refuses a
        mesh."""
        from manifold3d import Error

        from damageest.geometry.solids import to_manifold, to_solid

        origin = part.bounds.mean(axis=0)
        try:
            bodies = to_manifold(part, origin), to_manifold(solid, origin)
        except ValueError as error:
            raise StageError(str(error), "repair: pymeshfix", method="implicit") from None
        common = bodies[0] ^ bodies[1]
        if common.status() != Error.NoError:
            raise StageError(
                f"manifold3d could not intersect: {common.status().name}",
                "a slightly different tolerance, or boolean: pymeshlab",
            )
        return to_solid(common, origin)
