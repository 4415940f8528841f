"""The part divided along the damage surface, and the room round it by what is nearer: lost metal, or what is left."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from damageest.artefacts import Floats, Mesh, Part, Rims, Solid, Surface
from damageest.stages.enclose import Enclose

Side = Literal["auto", "smaller", "larger"]


class Divide(Enclose):
    """Divides the part along the damage surface, and the space up to the background by the nearer of both pieces.

    The wall between rim and background (paper 3.1 steps 8 to 11) is equally far from the lost metal and from the
    remaining part. It crosses neither the part nor itself: it suits every background, rims in bores and grooves, and
    walls worn through. It does not refine the background.
    """

    refines = True

    use: Literal["divide"] = "divide"
    overhang: float = Field(3.0, ge=0, le=20, description="extension of the surface beyond its rim, in tolerances")
    side: Side = Field(
        "auto",
        description="which side of the damage surface is lost: auto (the one without intact points), smaller or larger "
        "(by volume; for scans that show no skin beside the damage)",
    )

    def run(
        self, surface: Surface, rims: Rims, background: Solid, part: Part, intact: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where the extended surface runs through too much metal, or where the intact points do not
        show which side is lost; NotSeparatedError where the surface does not divide the part."""
        from damageest.stages.enclose._divide import divide_part
        from damageest.stages.enclose._outside import extend_outside
        from damageest.stages.enclose._room import join_room

        sheet = extend_outside(surface, rims, part, self.overhang * tolerance, tolerance)
        lost, left = divide_part(part, sheet, intact, self.side, tolerance)
        return join_room(lost, left, background, part)
