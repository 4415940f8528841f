"""Stage `background`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Floats, Part, Samples, Solid, Surface
from damageest.stages import Stage, asked_by_name


class Background(Stage, ABC):
    """Makes the background: a closed mesh around the inner damage surface (IDS), the lost metal and the part near them
    (paper 3.1 step 7). `enclose` joins the rims of the IDS to it.

    Args of ``run``, lengths in the job's unit, coordinates in the part's frame:
        part: the part as designed.
        surface: the IDS.
        tolerance: keep at least this far from the part's skin.
        spacing: distance between neighbouring points of the scan.
        fine: whether the vertices must lie close together (some tolerances) everywhere on the mesh; False where
            `enclose` refines the mesh itself.
        intact: (K,3) scan points on the intact skin.
        samples: points on all of the part's skin, with normals.

    Returns:
        A solid that holds all vertices of the IDS and all the lost metal. It may hold more, and usually holds the
        whole part.

    Raises:
        StageError: where the IDS is empty, or where no such solid can be made.

    Example::

        from typing import Literal
        import numpy as np
        from trimesh.creation import icosphere
        from damageest.artefacts import Part, Solid, Surface
        from damageest.stages.background import Background

        class Ball(Background):
            "A ball round the part; for parts about as long as wide."
            use: Literal["ball"] = "ball"

            def run(self, part: Part, surface: Surface, tolerance: float, fine: bool) -> Solid:
                centre = part.bounds.mean(axis=0)
                distance = np.linalg.norm(np.concatenate([part.vertices, surface.vertices]) - centre, axis=1)
                ball = icosphere(6 if fine else 3, 1.02 * distance.max() + 2 * tolerance)
                return Solid(ball.vertices + centre, ball.faces)
    """

    stage: ClassVar[str] = "background"
    gives: ClassVar[str] = "background"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(
        self,
        part: Part,
        surface: Surface,
        tolerance: float,
        spacing: float,
        fine: bool,
        intact: Floats,
        samples: Samples,
    ) -> Solid: ...
