"""Stage `boundary`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Rims, Surface
from damageest.stages import Stage, asked_by_name


class Boundary(Stage, ABC):
    """Finds the rims of an inner damage surface (IDS): the boundary loops that `enclose` joins to the background
    (paper 3.1 step 6). `enclose` closes the other loops flat, as gaps of the scan.

    Args of ``run``, lengths in the job's unit:
        surface: the IDS, an open mesh in the part's frame.
        part: the part as designed.
        tolerance: the rims of a damage lie about this far below the part's skin.

    Returns:
        Loops of indices (N,) into the surface's vertices. Each loop follows boundary edges of the surface and uses each
        once; the longest loop comes first.

    Raises:
        StageError: where there is no rim, or where two loops meet in a vertex.

    Example::

        from typing import Literal
        from pydantic import Field
        from damageest.artefacts import Rims, Surface
        from damageest.geometry.loops import trace_rims
        from damageest.stages.boundary import Boundary

        class LongLoops(Boundary):
            "The loops with many nodes; for scans with small gaps."
            use: Literal["long_loops"] = "long_loops"
            shortest: int = Field(40, ge=10, description="fewest nodes of a rim; the longest loop is always one")

            def run(self, surface: Surface) -> Rims:
                loops = trace_rims(surface)  # longest first; raises StageError where there is no rim
                return Rims((loops[0], *(loop for loop in loops[1:] if len(loop) >= self.shortest)))
    """

    stage: ClassVar[str] = "boundary"
    gives: ClassVar[str] = "rims"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, surface: Surface, part: Part, tolerance: float) -> Rims: ...
