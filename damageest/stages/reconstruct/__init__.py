"""Stage `reconstruct`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Floats, Part, Surface
from damageest.stages import Stage, asked_by_name


class Reconstruct(Stage, ABC):
    """Makes the inner damage surface (IDS) of one site from its points (paper 3.1 step 5).

    Args of ``run``, lengths in the job's unit:
        points: (M,3) the site's scan points in the part's frame, all on the damage.
        part: the part as designed.
        tolerance: depth from which a point counts as damage; the points end about this far below the skin.
        spacing: distance between neighbouring points of the scan.
        noise: standard deviation of the points off the local surface.

    Returns:
        An open mesh in the part's frame, with normals toward the lost metal. No more than two triangles share an edge.

    Raises:
        StageError: where no surface follows from the points. Give the reason, and a ``remedy``.

    Example::

        from typing import Literal
        import numpy as np
        from scipy.spatial import Delaunay, QhullError
        from damageest.artefacts import Floats, Part, Surface
        from damageest.errors import StageError
        from damageest.geometry.open_surfaces import centre_points, trim_surface
        from damageest.stages.reconstruct import Reconstruct

        class HeightField(Reconstruct):
            "One height over each point of the best plane; for shallow damage."
            use: Literal["height_field"] = "height_field"

            def run(self, points: Floats, part: Part, tolerance: float, spacing: float) -> Surface:
                local = points - centre_points(points)  # raises StageError for too few points
                flat = local @ np.linalg.svd(local, full_matrices=False)[2][:2].T
                try:
                    faces = Delaunay(flat).simplices
                except QhullError:
                    raise StageError("the points lie on a line", method="implicit") from None
                return trim_surface(points, faces, points, 3 * spacing, part, tolerance)
    """

    stage: ClassVar[str] = "reconstruct"
    gives: ClassVar[str] = "surface"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface: ...
